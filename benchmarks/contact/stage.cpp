// Time of time steps with contact from a state, as in a run, without saving:
//
//   step            a time step
//   step_dynamics   only its generated function
//
// argv: the work, the number of repetitions, the number of steps in each.
// stdin: as in given.hpp, then the solids (kind, link, a, b, R, half, radius), the pairs, the
// groups, friction, restitution and meetings, each after their number.
// stdout: for each repetition, the processor time of one step [s]; then the number of points that
// push, their normal force [N], the largest overlap [m], the largest residual of the law.
#include "fantoccini/collision/touch_unit.hpp"

#include "main.cpp"
#include "../speed/given.hpp"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>

namespace {

using fan::Model;
constexpr int NQ = Model::n_qD, N = Model::n_vD, S = Model::n_strings, M = Model::n_rows;

using Run = fan::GridRun<fan::TimeSteppingTrajectory<Model, double>>;
Run run;
std::vector<fan::Solid> solids;
std::vector<int> pairs, groups, meetings;
std::vector<double> friction, restitution;
fan::ContactArrays arrays;

std::vector<int> take_whole(int width) {
  std::vector<int> out;
  for (double x : take(width * int(take(1)[0]))) out.push_back(int(x));
  return out;
}

void take_contacts() {
  const int n = int(take(1)[0]);
  for (int i = 0; i < n; ++i) {
    const auto x = take(21);
    fan::Solid one{};
    one.kind = int(x[0]), one.link = int(x[1]), one.mesh = -1;
    std::memcpy(one.a, &x[2], 19 * sizeof(double));
    solids.push_back(one);
  }
  pairs = take_whole(2), groups = take_whole(3);
  friction = take(int(take(1)[0])), restitution = take(int(take(1)[0]));
  meetings = take_whole(1);
  arrays = {
      n,
      (long long)(pairs.size() / 2),
      (long long)(groups.size() / 3),
      solids.data(),
      pairs.data(),
      groups.data(),
      friction.data(),
      restitution.data(),
      meetings.data()};
}

constexpr int row_capacity = 4, some_events = 4096, some_points = 4 * (Model::n_contacts + 1);
double row[fan::Record<Model>::Layout::width * row_capacity];
double event[fan::EventLayout::width * some_events];
double point[fan::ContactLayout::width * some_points];

fan::Record<Model> record() {
  fan::Record<Model> out{};
  out.samples = row, out.sample_capacity = row_capacity;
  out.events = event, out.event_capacity = some_events;
  out.contacts = point, out.contact_capacity = some_points;
  return out;
}

void begin() {
  auto out = record();
  begin_steps(run, pairs.empty() ? nullptr : &arrays, out);
}

void steps(int n) {
  auto out = record();
  for (int i = 0; i < n; ++i) {
    out.n_events = 0;
    if (run.run(1e9, 1, out) != fan::RUNNING) std::exit(3);
  }
}

void step_dynamics(int n) {
  auto& led = run.trajectory();
  for (int i = 0; i < n; ++i)
    led.at.eval.at(
        led.state().q_D, led.state().v_D, led.inputs().q_K, led.inputs().v_K, led.inputs().acc_K,
        led.inputs().u_D, led.state().v_D, number[0], led.p());
}

}  // namespace

int main(int, char** argv) {
  const bool stepping = !std::strcmp(argv[1], "step");
  const int times = std::atoi(argv[2]), n = std::atoi(argv[3]);
  take_all();
  take_contacts();
  for (int i = 0; i <= times; ++i) {  // the first is a warm-up
    begin();
    const std::clock_t start = std::clock();
    (stepping ? steps : step_dynamics)(n);
    const double took = double(std::clock() - start) / CLOCKS_PER_SEC;
    if (i > 0) std::printf("%.9g\n", took / n);
  }
  int points = 0;
  double force = 0.0, depth = 0.0, residual = 0.0;
  if constexpr (Model::n_contacts > 0) {
    const auto& contacts = run.trajectory().at.contacts;
    points = contacts.n[0];
    residual = contacts.residual;
    for (int i = 0; i < points; ++i) {
      const auto& push = contacts.push[0][i];
      force += fan::dot3(push.impulse, push.normal) / number[0];
      if (-push.gap > depth) depth = -push.gap;
    }
  }
  std::printf("%d %.9g %.9g %.9g\n", points, force, depth, residual);
  return 0;
}
