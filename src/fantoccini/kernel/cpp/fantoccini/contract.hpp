// The contract between Python and compiled code, made by `python -m fantoccini.kernel.contract`
// from fantoccini/kernel/contract/*.py: change it there.
#pragma once

#include "fantoccini/math/real.hpp"

namespace fan {

// A hash of the contract.
constexpr long long contract_digest = 0x48f3634dd075e199;

// Identity of a library, which Python checks when it loads it: the contract's hash, how many
// trajectories or configurations are advanced together, and the puppet's sizes.
template <class Sizes>
void identity(int width, long long* out) {
  const long long values[] = {
      contract_digest, width, Sizes::n_qD, Sizes::n_vD, Sizes::n_qK, Sizes::n_vK, Sizes::n_v,
      Sizes::n_strings, Sizes::n_limits, Sizes::n_rows, Sizes::n_p, Sizes::n_links,
      Sizes::n_points, Sizes::n_motors, Sizes::n_watched, Sizes::n_contacts,
      Sizes::n_solids, Sizes::n_packed};
  for (long long value : values) *out++ = value;
}

// Numbers that Python compares with, too.
struct Constants {
  // largest tension relative to the weight: beyond it the input is impossible
  static constexpr double tension_cap = 100000.0;
  // -h up to which a row is closed, relative to its string's length or to 1
  static constexpr double closed_gap = 5e-13;
  // the same where a run begins, which brings the row to h = 0
  static constexpr double start_gap = 1e-09;
  // hdot up to which a closed row is at rest, times the largest velocity if that is above 1
  // [m/s or rad/s]
  static constexpr double rest_speed = 1e-05;
  // lower bound of the length by which a string's gap is divided [m]
  static constexpr double least_length = 0.001;
  // of a winch that rewinds, before it stops [m/s^2]
  static constexpr double winch_deceleration = 1.0;
  // most vertices of a convex polytope that touches something
  static constexpr double hull_vertices = 128.0;
};

// How a run ended. Compiled code has the same numbers (``contract.hpp``).
enum Status : int {
  DONE = 0,  // the run reached its end
  RUNNING = 1,  // the run has not reached its end yet
  IMPOSSIBLE_INPUT = 2,  // the inputs ask for a motion that no puppet on these strings can follow
  TENSION_CAP = 3,  // a tension passed the cap on what a string may pull
  STEP_TOO_SMALL = 4,  // the step size fell below what the clock can resolve
  TOO_MANY_EVENTS = 5,  // strings caught and released more often than the bound on events
  TOO_MANY_STEPS = 6,  // the bound on the number of steps was reached
  NOT_FINITE = 7,  // a state or a force is no longer a finite number
  COLLAPSED = 8,  // two neighbouring points of a taut string came together
  LENGTH_NOT_POSITIVE = 9,  // a string's length was driven to zero or below
  PROJECTION_FAILED = 10,  // the strings could not be brought back to their lengths
  STOPPED = 11,  // the run was stopped from outside
  SINGULAR_MASS = 12,  // the mass matrix is singular: a joint moves no mass
  NOT_SETTLED = 13,  // the equations of a step could not be solved
  LOST_STEPS = 14,  // a stepper lost steps on the way; the run went on to its end
  // a load dragged a drive away although its motor or controller gave all it can; the run ends
  // early where it is gone too far
  RUNAWAY = 15,
  TOO_MANY_SAMPLES = 16,  // the samples of the run reached the bound on memory
  REDUNDANT_STRINGS = 17,  // redundant strings contradict one another
  OVERSTEPPED = 18,  // the end was reached, but strings, limits or contacts were overstepped
  GAINED_ENERGY = 19,  // the end was reached, but the fixed step made energy out of nothing
  TOO_MANY_CONTACTS = 20,  // more points touched at once than a step has room for
  NO_UNIQUE_MOTION = 21,  // friction jams what slides (Painlevé): no finite force, or several
  UNBALANCED = 22,  // the end was reached, but the ledger of the fixed steps does not balance
  OUT_OF_TIME = 23,  // the time limit on computing ended the run
};

// What happened to a row or a drive.
enum EventCode : int {
  CATCH = 0,  // a slack string came taut, or a limit was reached
  RELEASE = 1,  // a string went slack, or a limit was left
  ACCUMULATION = 2,  // infinitely many catches were taken as one
  BREAKPOINT = 3,  // the inputs may jump in acceleration
  SLIP = 4,  // the winch began to slip
  GRIP = 5,  // the winch grips again
  LOST_STEP = 6,  // a stepper motor lost a step
  RAN_AWAY = 7,  // a drive ran away
  TOUCH = 8,  // two solids came into contact
  LIFT = 9,  // two solids parted
  STICK = 10,  // two solids that touch stopped sliding
  SLIDE = 11,  // two solids that touch began to slide
};

// What a row does between two events.
enum Hold : signed char {
  SLACK = 0,  // no force
  HELD = 1,  // active
  IDLE = 2,  // redundant: depends on the held rows, active without tension
  PINNED = 3,  // redundant, at its winch's largest tension
  SLIPPING = 4,  // pulls with its winch's largest tension while the winch slips
};

// Kinds of solids.
enum SolidKind : int {
  SEGMENT = 0,  // from a to b, inflated by the radius; with half[0] > 0 the ellipsoid in it
  BOX = 1,  // centre a, axes the columns of R, half edges, inflated by the radius
  HALF_SPACE = 2,  // below the plane through a with the normal b
  HULL = 3,  // convex polytope `hull`: its origin a, axes the columns of R, inflated by the radius
};

// Kinds of goals.
enum GoalKind : int {
  UNKNOWN = 0,  // evaluated in Python
  POSE = 1,  // every dynamic coordinate with a weight lies between low and high
  POINT = 2,  // a point of a link lies in the box from place to place_high
};

// How a complementarity solve ended.
enum class Solved : int {
  YES = 0,  // solved
  INFEASIBLE = 1,  // there is no solution
  UNSETTLED = 2,  // the bound on iterations was reached
  NO_ROOM = 3,  // more rows than the puppet has, or no memory
};

// How a search for the pose nearest to places ended.
enum class ReachEnd : int {
  REACHED = 0,  // it is there, within the tolerance
  NEAREST = 1,  // no hanging pose near by is nearer
  STALLED = 2,  // no step came nearer any more, or the iterations ended first
  LOST = 3,  // the puppet does not hang where it was to begin
  TIPS = 4,  // any nearer, no pose that hangs stably is found
};

// What a fixed step is on the edge of, as bits; from LEAVES_LAW on it has no derivative.
enum StepEdge : int {
  WITHOUT_FORCE = 1,  // a point touches without force
  STRAINED = 2,  // a point sticks at the edge of its cone
  MAY_REBOUND = 4,  // a point springs back if any faster, or is not the only one that touches first
  NOT_SMOOTH = 8,  // the place of a point has no derivative
  ASKEW = 16,  // a point touches without force, and slides askew of those that push
  // bodies are wedged in, restitution is scaled down to add no energy, or points spring back
  // one after the other
  LEAVES_LAW = 32,
  JAMS = 64,  // friction jams: no forces keep the modes
  OPEN_SHARES = 128,  // solids slide on more points than the law can share force among
  CROWDED = 256,  // more points push than there is room for
};

// An input: arrays in C order.
struct InputArrays {
  int n_segments;  // pieces
  const double* breaks;  // (n_segments + 1,) [s]
  const double* coef;  // (n_segments, n_vK, 6)
  const double* base;  // (n_segments, n_qK)
  const double* force;  // (n_segments, n_vD, 6) or null
};

// A convex polytope around the origin.
struct Hull {
  int n_vertices;
  int n_facets;
  int n_edges;
  double inner;  // radius of the largest ball about the origin inside [m]
  double outer;  // radius of the smallest ball about the origin around it [m]
  const double* vertices;  // (n_vertices, 3) [m]
  const double* planes;  // (n_facets, 4) outward unit normal; height above the origin [m]
  const int* begins;  // (n_facets + 1,) where the corners of each facet begin
  const int* corners;  // vertices of each facet in turn, anticlockwise seen from outside
  const int* sides;  // the edge from each corner to the next
  const int* edges;  // (n_edges, 4) two vertices, the facets to the left and right
  const int* around_begins;  // (n_vertices + 1,) where the facets of each vertex begin
  const int* around;  // facets of each vertex
};

// A solid in the frame of a link or of the world.
struct Solid {
  int kind;  // SolidKind
  int link;  // -1 for the world
  long long mesh;  // index of the hull, or of the mesh that this box encloses; or negative
  double a[3];
  double b[3];
  double R[9];  // column by column
  double half[3];
  double radius;  // [m]
  const Hull* hull;  // null but for hulls
};

// Solids that may touch, and how.
struct ContactArrays {
  long long n_solids;
  long long n_pairs;
  long long n_groups;
  const Solid* solids;  // those of the links, then those that stand
  const int* pairs;  // (n_pairs, 2) of solids; the second may stand in the world
  // (n_groups, 3) of pairs of the same two links, or of a link and a solid that stands: first
  // link; second link, or -1 - the solid; where the pairs end
  const int* groups;
  const double* friction;  // (n_pairs,) coefficient of Coulomb's law
  const double* restitution;  // (n_pairs,) 0 to 1
  const int* meetings;  // (n_pairs,) the first pair of parts of the same two names
};

// Options of a run.
struct Options {
  double rtol;  // of the event-driven integrator
  double atol;  // likewise
  double first_step;  // [s]
  double max_step;  // [s]
  double tension_cap;  // [N]; times 1 m of a limit, times 1 s of an impulse
  double energy_scale;  // size of the work and loss integrals, for errors [J]
  double force_scale;  // size of forces that balance, M_DD one [kg^1/2 m/s^2]
  double recovery_speed;  // cap on how fast time-stepping undoes a violation [m/s]
  double dt;  // fixed step [s]
  long long max_steps;
  long long max_events;
  int save_steps;  // save every accepted step
  int extrapolate;  // time-stepping: velocity products half a step ahead
  const ContactArrays* contacts;  // null without contact; must outlive the run
};

// Where a run writes samples and events.
struct RecordArrays {
  double* samples;  // (sample_capacity, SampleLayout::width)
  long long sample_capacity;
  long long n_samples;  // written
  double* events;  // (event_capacity, EventLayout::width)
  long long event_capacity;
  long long n_events;  // written
  double* contacts;  // (contact_capacity, ContactLayout::width)
  long long contact_capacity;
  long long n_contacts;  // written
};

// The start of a run.
struct StartArrays {
  double t;  // [s]
  const double* q_D;  // (n_qD,)
  const double* v_D;  // (n_vD,)
  const double* slip;  // (n_strings,) [m]
  const double* p;  // (n_p,)
  const double* winches;  // (n_strings, WinchLayout::width)
  InputArrays input;
  Options options;
  const double* save_at;  // (n_save,) times of samples, event-driven; must outlive the run [s]
  long long n_save;
  int save_every;  // fixed steps from sample to sample
};

// How far a run is.
struct RunProgress {
  long long steps;  // taken
  double t;  // reached [s]
  double violation;  // largest so far, of fixed steps [m or rad]
};

// An array of every trajectory.
struct Shared {
  const double* first;  // or null
  long long stride;  // from one trajectory to the next; 0 where all share one
};

// A batch: its starts and where its samples go.
struct BatchArrays {
  long long n;  // trajectories
  double t;  // start of all [s]
  double t_end;  // end of all [s]
  Shared q_D;
  Shared v_D;
  Shared slip;
  int n_segments;  // of every input
  Shared breaks;
  Shared coef;
  Shared base;
  Shared force;
  Shared p;
  const double* winches;  // of all
  Options options;
  int save_every;  // fixed steps from sample to sample
  const double* save_at;  // (n_samples,) times of event-driven samples, from t to t_end [s]
  long long n_samples;  // of a trajectory
  void* parts[11];  // (n, n_samples, width) or null; taut in bytes
  int* status;  // (n,) Status
  double* reached;  // (n,) [s]
  double* violation;  // (n,) largest, of fixed steps
  long long* catches;  // (n,)
  long long* releases;  // (n,)
  double* blame;  // (n, n_rows + n_watched)
  double* end_q_D;  // (n, n_qD) the configuration reached
  double* end_v_D;  // (n, n_vD) the velocities there
};

// Trajectories that are advanced piece by piece, and one piece.
struct StepperArrays {
  long long n;  // trajectories
  double duration;  // of the piece; 0 only begins those that are fresh [s]
  Options options;
  const double* winches;  // of all
  Shared acc_K;  // (n_vK,) held over the piece
  Shared u_D;  // (n_vD,) held over the piece, or null
  unsigned char* fresh;  // (n,) whether to restart from the arrays; cleared
  const double* p;  // (n, n_p)
  double* q_D;  // (n, n_qD) state before the piece, then after it; so are the others
  double* v_D;  // (n, n_vD)
  double* q_K;  // (n, n_qK)
  double* v_K;  // (n, n_vK)
  double* slip;  // (n, n_strings)
  double* tension;  // (n, n_rows) written
  unsigned char* taut;  // (n, n_rows) written
  double* books;  // (n, 5) work, damping, impact, slip loss, friction; written [J]
  double* violation;  // (n,) largest since it began; written
  double* advanced;  // (n,) time by which it was advanced in the piece; written [s]
  int* status;  // (n,) Status; written
  double* blame;  // (n, n_rows + n_watched) shares of the blame for it; written
};

// A point that pushes in a fixed step, in its mode.
struct StepContact {
  int pair;  // of ContactArrays
  int feature;  // which of the pair's points
  int links[2];  // of the two solids; -1 for the world
  int sticks;  // else it slides
  int turns;  // whether the direction of sliding turns with the velocity
  double friction;  // coefficient
  double gap;  // [m]
  double closes;  // d(gap speed)/d(gap) that the step asks for [1/s]
  double bounces;  // restitution that it asks for
  double at[3];  // place in the world [m]
  double normal[3];  // from the second solid to the first
  double force[3];  // on the first solid [N]
  double velocity[3];  // of the first solid against the second after it [m/s]
  double along[3];  // direction of sliding; 0 where it sticks
  double by[42];  // (7, 6) gap, place and normal by a twist of the first link about the origin
};

// First time steps with contact, one for each node.
struct TouchingStepArrays {
  Options options;
  const double* winches;  // of all
  double reference_force;  // a weight [N]
  int room;  // for points of a node
  Shared p;
  Shared acc_K;  // at the start
  Shared u_D;  // or null
  const double* q_D;  // (n, n_qD) starts
  const double* v_D;  // (n, n_vD)
  const double* q_K;  // (n, n_qK)
  const double* v_K;  // (n, n_vK)
  double* slip;  // (n, n_strings) at the start, and then after the step
  const double* rate;  // (n, n_vK) dq_K/dt over the step
  const double* mean;  // (n, n_vK) dv_K/dt over the step
  double* q_D_next;  // (n, n_qD) after the step; so the others
  double* v_D_next;  // (n, n_vD)
  double* q_K_next;  // (n, n_qK)
  double* v_K_next;  // (n, n_vK)
  double* tension;  // (n, n_rows)
  unsigned char* taut;  // (n, n_rows)
  int* status;  // (n,) Status
  // (n,) how long the steps move on before what springs back touches [s]; all of points and
  // screws is there
  double* delay;
  int* edges;  // (n,) StepEdge
  int n_pairs;  // of ContactArrays
  int* pair_edges;  // (n, n_pairs) StepEdge of every pair; set to 0 before
  int* n_points;  // (n,) that push
  StepContact* points;  // (n, room)
  double* screws;  // (n, n_vD + n_vK, 6) at the start, as the function of this name
  // (n, n_links + n_vD + n_vK, 6, n_p) twists of links and changes of screws by the
  // parameters; null without any
  double* by_p;
};

// Time steps and their derivatives, one for each node.
struct StepDerivativeArrays {
  double dt;  // length of all steps [s]
  double recovery_speed;  // as in Options [m/s]
  int forces;  // whether to differentiate by u_D, too
  Shared p;
  Shared u_D;  // or null
  const double* q_D;  // (n, n_qD) starts
  const double* v_D;  // (n, n_vD)
  const double* q_K;  // (n, n_qK)
  const double* rate;  // (n, n_vK) dq_K/dt over the step
  const double* mean;  // (n, n_vK) dv_K/dt over the step
  const double* slip;  // (n, n_strings)
  const double* tension;  // (n, n_rows) of the step
  const unsigned char* held;  // (n, n_rows) rows that the step holds
  const int* cap_by;  // (n_rows,) which parameter a largest tension is; -1 for none
  double* acc_D;  // (n, n_vD) mean acceleration over the step
  // (n, 2 n_vD, m) of (dq_D, v_D) after the step by q_D, v_D, q_K, v_K, acc_K, u_D if asked
  // for, and p; of driven rotations by rate and mean
  double* motion;
  double* pull;  // (n, n_rows, m) of the tensions; null: not asked for
  // (n, 3 room, m) of the points' multipliers: along the normal, and along two tangents where
  // it sticks; point after point; null: not asked for
  double* shares;
  // (n, n_vD + n_vK, m) of the configuration where what springs back touches, of steps in
  // which something does; null without shares
  double* moved;
  const int* n_points;  // (n,) points that push; null without contact
  const double* delay;  // as in TouchingStepArrays; null without contact
  int room;  // for points of a node
  const StepContact* points;  // (n, room)
  const double* screws;  // as in TouchingStepArrays
  const double* by_p;  // likewise
  int* edges;  // (n,) StepEdge; added to
};

// A smooth piece of a run, and small changes along it.
struct FlowDerivativeArrays {
  double rtol;  // of the integration of state and changes
  double atol;  // likewise
  double step;  // that is tried first, and at the end would be tried next [s]
  double start;  // [s]
  long long n_times;
  const double* times;  // (n_times,) at which to write, increasing, up to the end [s]
  InputArrays input;  // of one piece
  int m;  // changes: by the state, by the parameters, along the inputs
  int n_inputs;  // those along the inputs
  // (6, 3 n_vK + n_vD, n_inputs) changes of q_K, v_K, acc_K and u_D in powers of the time
  // since the start over the whole
  const double* by_inputs;
  const double* p;
  const unsigned char* held;  // (n_rows,) rows that are held
  const double* q_D;  // (n_qD,) at the start
  const double* v_D;  // (n_vD,)
  const double* changes;  // (2 n_vD, m) of (q_D, v_D)
  double* q_D_at;  // (n_times, n_qD)
  double* v_D_at;  // (n_times, n_vD)
  double* changes_at;  // (n_times, 2 n_vD, m)
  int status;  // Status
};

// A quadratic program of stages (search/stage_program.hpp).
struct StageProgramArrays {
  long long N;  // stages
  int n_z;  // states of a stage
  int k;  // inputs
  int m;  // rows
  const double* H;  // (N, k + n_z, k + n_z) of (u_i, z_{i+1})
  const double* g;  // (N, k + n_z)
  const double* cross;  // (N, k + n_z, k) of (u_{i-1}, z_i) with u_i
  const double* A;  // (N, n_z, n_z)
  const double* B;  // (N, n_z, k)
  const double* e;  // (N, n_z)
  const double* low;  // (N, k + n_z) bounds of (u_i, z_{i+1})
  const double* high;  // (N, k + n_z)
  const double* C;  // (N, m, 2 k + n_z) rows of (u_{i-1}, z_i, u_i)
  const double* row_low;  // (N, m)
  const double* row_high;  // (N, m)
  const double* price;  // (N, m) of passing a row
  double unit;  // of the cost
  double unbounded;  // from which a bound is none
  double tolerance;  // of the residuals; ten times as much of the barrier
  double barrier;  // least product of slacks and multipliers
  int most_iterations;
  double* u;  // (N, k)
  double* z;  // (N, n_z) of z_1 and later
  double* costate;  // (N, n_z) multipliers of the dynamics
  double* passed;  // (N, m) how far rows are passed
  double* force;  // (N, m) multipliers of the rows
  double* gain;  // (k, n_z) of u_0 by z_0 with the last factors, or null
  int iterations;  // factorisations made
  int solved;  // whether the tolerance was reached
  double primal;  // residual of the bounds
  double dual;  // residual of stationarity, relative to g
  double gap;  // mean product of slacks and multipliers
};

// A time step in every interval (search/stage_dynamics.hpp).
struct StageStepArrays {
  long long N;  // intervals
  int n_d;  // 2 n_vD
  int k;  // n_vK
  int columns;  // of motion, the first n_d + 3 k count
  int is_first;  // of the steps of an interval
  const double* motion;  // (N, n_d, columns) of (dq_D, v_D) after the step, as linearised
  Shared driven;  // (2 k, 3 k) of (dq_K, v_K) before it by q_K, v_K and acc_K at the start
};

// A program of stages in real time (search/stage_clamped.hpp).
struct StageClampArrays {
  long long N;  // stages
  int n_d;  // 2 n_vD
  int n_inputs;  // n_vK; n_z = n_d + 2 n_vK
  int k;  // inputs that take part
  const int* inputs;  // (k,) which
  int n_squares;  // rows of J
  int n_pulls;  // rows of C
  int n_joints;  // numbers of the state with bounds that may be passed
  Shared driven;  // (2 n_vK, 3 n_vK) of (dq_K, v_K) after the interval
  const double* squares;  // (N, n_squares, n_z) J of z_{i+1}
  const double* diagonal;  // (N, n_vK + n_z) of (u_i, z_{i+1})
  const double* g;  // (N, n_vK + n_z)
  double jerk;  // c: less u_{i-1} . u_i times this
  const double* pulls;  // (N, n_pulls, n_z + n_vK) C of (z_i, u_i)
  const double* pull_weight;  // (N, n_pulls) W
  double h;  // length of an interval [s]
  const double* acc;  // (N, n_vK) at which changes begin
  const double* q;  // (N + 1, n_vK) numbers of the driven coordinates
  const double* v;  // (N + 1, n_vK)
  const double* most;  // (n_vK,) of accelerations
  const double* last_most;  // (n_vK,) of the last acceleration
  const double* speed;  // (n_vK,) largest
  const double* low;  // (n_vK,) of the numbers
  const double* high;  // (n_vK,)
  const int* joint_places;  // (n_joints,) places in z
  const double* joint;  // (N, n_joints) values after the intervals
  const double* joint_low;  // (n_joints,)
  const double* joint_high;  // (n_joints,)
  double price;  // of passing a bound
  double unit;  // of the cost
  int shift;  // stages by which the horizon went on since the one before; -1: anew
  int most_stages;  // that may be factorised in all
  double* u;  // (N, n_vK) changes of the accelerations
  double decrease;  // of the cost
  int iterations;  // factorisations begun
  int stages;  // factorised in all
  int solved;  // whether bounds in force are the right ones
};

// A rollout of fixed steps, and the gradient of its cost.
struct GradientArrays {
  long long n;  // steps
  Options options;
  const double* winches;
  const double* p;
  Shared u_D;  // by step, or null
  const double* q_K;  // (n + 1, n_qK) by node
  const double* v_K;  // (n + 1, n_vK)
  const double* rate;  // (n, n_vK) dq_K/dt over the steps
  const double* mean;  // (n, n_vK) dv_K/dt over the steps
  double* q_D;  // (n + 1, n_qD) the first is given
  double* v_D;  // (n + 1, n_vD) likewise
  double* acc_D;  // (n, n_vD) mean accelerations over the steps
  double* tension;  // (n, n_rows)
  double* ahead;  // (n, 2) times by which acc_D and its change run ahead [s]
  double reference_force;  // a weight [N]
  int* n_points;  // (n,) points of contact that push in the steps
  int* n_sliding;  // (n,) those that slide
  int* edges;  // (n,) StepEdge; a sweep adds to them and ends where it has to
  int* pairs;  // (n,) pair of contact that is on an edge; -1 for none
  double slip;  // largest [m]
  long long shortened;  // first step that was cut short; n for none
  long long made;  // steps before something stopped the rollout
  int status;  // Status
  const unsigned char* held;  // (n, n_rows) rows that the steps hold
  const double* l_q;  // (n + 1, n_vD) the cost's own derivatives: by tangents of q_D
  const double* l_v;  // (n + 1, n_vD) by v_D
  const double* l_tension;  // (n, n_rows) by the tensions, or null
  double* g_q;  // (n_vD,) gradient by tangents of q_D at the start
  double* g_v;  // (n_vD,) by v_D there
  double* g_qK;  // (n, n_vK) by tangents of q_K in the steps
  double* g_rate;  // (n, n_vK) by the rates
  double* g_mean;  // (n, n_vK) by the mean accelerations
  double* g_u;  // (n, n_vD) by u_D
  double* g_p;  // (n_p,)
};

// Places, and the hanging poses nearest to them.
struct ReachArrays {
  long long n;  // poses
  int n_targets;  // points and coordinates with a place in every pose
  const int* links;  // (n_targets,) of points; -1 for coordinates
  const int* columns;  // (n_targets,) of coordinates: the velocity, v_K after v_D
  const double* at;  // (n_targets, 3) points in their links' frames [m]
  const unsigned char* moves;  // (n_targets, n_vD + n_vK) velocities that move the link
  const double* places;  // (n, n_targets, 3) NaN is free; a coordinate's value is the first
  const double* weights;  // (n_targets,) of squared distances
  int once;  // whether poses that are not reached are not looked for again
  const double* q_D;  // (n_qD,) where the first pose begins
  const double* q_K;  // (n_qK,)
  const double* p;  // (n_p,)
  const double* tension;  // (n_rows,)
  const unsigned char* held;  // (n_rows,) rows that pull
  const unsigned char* may_change;  // (n_rows,) rows that may begin or cease to
  const int* lengths;  // (n_rows,) of driven strings: place of the length in v_K; else -1
  const unsigned char* moved;  // (n_vK + n_p,) what is chosen
  const double* low;  // (n_vK + n_p,) bounds of scalars
  const double* high;  // (n_vK + n_p,)
  const double* tension_low;  // (n_rows,) of rows that pull
  const double* tension_high;  // (n_rows,)
  const double* joint_low;  // (n_vD,) of scalars
  const double* joint_high;  // (n_vD,)
  double weight;  // of the puppet, as the size of forces [N]
  double tolerance;  // of the distance [m or rad]
  int max_iterations;
  int* status;  // (n,) ReachEnd
  int* iterations;  // (n,)
  double* out_q_D;  // (n, n_qD)
  double* out_q_K;  // (n, n_qK)
  double* out_p;  // (n, n_p)
  double* out_tension;  // (n, n_rows)
  unsigned char* out_held;  // (n, n_rows)
  double* left;  // (n, n_targets, 3) from the place to where it is; 0 where free
  double* price;  // (n, n_vK + n_p + n_rows + n_vD) multipliers of bounds: above 0 at the high one
  double* by;  // (n, n_vK + n_p, n_vD) derivative of q_D by what is chosen
  unsigned char* stable;  // (n,) whether V has a minimum there
};

// A link's joint, and where its coordinates are.
struct JointPlace {
  int parent;  // link, or -1 for the world
  int role;  // 0: it does not move; 1: in q_D; 2: in q_K
  int q;  // first of its coordinates
  int slides;  // coordinates along axes, which come first
  int turns;  // coordinates that turn it: 1 for an angle, 4 for a quaternion
};

// Solids and pairs of them whose clearance is measured.
struct ClearanceArrays {
  long long n_moving;
  long long n_standing;
  long long n_pairs;
  const Solid* moving;  // against all standing solids
  const Solid* standing;
  const int* pairs;  // (n_pairs, 2) of moving solids, against one another
  // (n_moving, n_standing) those that are not measured against one another
  const unsigned char* left_out;
  const double* string_radius;  // (n_strings,) against standing solids; negative: not measured
  const JointPlace* joints;  // (n_links,)
  const int* carriers;  // (n_points,) links of the strings' points; -1 for the world
  // distance of two solids one of which is a mesh, without radii; null without mesh
  double (*exact)(const Solid*, const Solid*);
};

// A goal.
struct GoalArrays {
  int kind;  // GoalKind
  int link;  // of a point
  const double* low;  // (n_qD,) of a pose; an orientation is at low, with its first weight
  const double* high;  // (n_qD,)
  const double* weight;  // (n_vD,)
  const double* v_D;  // (n_vD,) target
  const double* v_K;  // (n_vK,) target
  double at[3];  // the point in its link's frame [m]
  double place[3];  // low corner of the box it must reach [m]
  double place_high[3];  // high corner [m]
  double speed_weight;  // of the error of v_D [s]
  double driven_weight;  // of the error of v_K [s]
  double tolerance;  // of the distance; negative: never stop at the goal
  int n_touches;  // touches that are asked for
  const int* touches;  // (n_pairs,) of contact: the touch that a pair is part of, or -1
  double open;  // added to the distance while some touch does not push
};

// An equilibrium and the gains of the feedback to it.
struct FunnelArrays {
  const double* q_D;  // (n_qD,)
  const double* q_K;  // (n_qK,)
  const double* gains;  // (n_vK, 2 n_vD + 2 n_vK) on (dq_D, v_D, dq_K, v_K)
};

// Bounds of the driven coordinates.
struct BoundArrays {
  const double* speed;  // (n_vK,)
  const double* acceleration;  // (n_vK,)
  const double* low;  // (n_qK,)
  const double* high;  // (n_qK,)
};

// Results of every segment.
struct SegmentArrays {
  double* q_D;  // (n, segments, n_qD) at its end
  double* v_D;  // (n, segments, n_vD)
  double* slip;  // (n, segments, n_strings)
  double* q_K;  // (n, segments, n_qK)
  double* v_K;  // (n, segments, n_vK)
  double* distance;  // (n, segments) to the goal there
  int* looks;  // (n, segments) it lasted; 0 where there is none
  int* catches;  // (n, segments) of strings and limits
};

// A planner's rollouts.
struct RolloutArrays {
  long long n;  // rollouts
  int segments;  // of a rollout, at most
  int looks;  // of a segment
  int steps;  // of a look
  Options options;
  const double* p;
  const double* winches;
  const long long* start;  // (n,) index of the start of each rollout
  const double* q_D;  // starts
  const double* v_D;
  const double* slip;
  const double* q_K;
  const double* v_K;
  double* acc_K;  // (n, segments, n_vK); those not given are led, and written
  const int* n_segments;  // (n,) segments of each, at least one
  const int* n_given;  // (n,) leading segments whose accelerations are given
  const int* funnel;  // (n,) index of its funnel
  const double* lead_time;  // (n,) time by which its reference runs ahead [s]
  const FunnelArrays* funnels;
  BoundArrays bounds;
  double margin;  // least clearance [m]
  int may_slacken;  // whether strings that pull may go slack
  const ClearanceArrays* solids;
  const unsigned char* kept_off;  // (n_pairs,) of contact: those that must not touch; null: none
  GoalArrays goal;
  SegmentArrays out;
};

// What the threads that simulate rollouts share.
struct RolloutProgress {
  long long next;  // next rollout to simulate
  long long reached;  // first rollout at the goal; n while none is; -1 abandons all
};

// Offsets of the parts of a sample.
template <class Model>
struct SampleLayout {
  static constexpr int t = 0;  // time [s]
  static constexpr int q_D = t + 1;  // dynamic configuration; quaternions of unit length
  static constexpr int v_D = q_D + Model::n_qD;  // dynamic velocity
  static constexpr int acc_D = v_D + Model::n_vD;  // dynamic acceleration
  // driven configuration; quaternions of unit length
  static constexpr int q_K = acc_D + Model::n_vD;
  static constexpr int v_K = q_K + Model::n_qK;  // driven velocity
  static constexpr int acc_K = v_K + Model::n_vK;  // driven acceleration
  // tensions of strings, forces of limits [N or N m]
  static constexpr int tension = acc_K + Model::n_vK;
  static constexpr int taut = tension + Model::n_rows;  // 1 where the row is active, else 0 [1]
  static constexpr int kinetic = taut + Model::n_rows;  // kinetic energy [J]
  static constexpr int potential = kinetic + 1;  // potential energy [J]
  static constexpr int work = potential + 1;  // work of the inputs [J]
  static constexpr int damping = work + 1;  // lost to damping and drag [J]
  static constexpr int impact = damping + 1;  // lost at catches [J]
  static constexpr int slip_loss = impact + 1;  // lost by slipping winches [J]
  static constexpr int friction = slip_loss + 1;  // lost to friction of contacts [J]
  static constexpr int slip = friction + 1;  // what the winches have let out [m]
  // of the laws of contact in the step before: a speed, relative to the largest in them [1]
  static constexpr int contact_residual = slip + Model::n_strings;
  static constexpr int width = contact_residual + 1;
};

// Offsets of the parts of an event.
struct EventLayout {
  enum : int { t, kind, row, impulse, speed, width };
};

// Offsets of the parts of a contact point.
struct ContactLayout {
  static constexpr int sample = 0;  // which of the record's samples [1]
  static constexpr int pair = sample + 1;  // which pair of solids [1]
  static constexpr int gap = pair + 1;  // between their surfaces; negative where they overlap [m]
  static constexpr int point = gap + 1;  // midway between them, in the world [m]
  static constexpr int normal = point + 3;  // from the second solid to the first [1]
  static constexpr int force = normal + 3;  // on the first solid, in the world [N]
  static constexpr int velocity = force + 3;  // of the first solid against the second there [m/s]
  static constexpr int width = velocity + 3;
};

// Offsets of the numbers of a winch.
struct WinchLayout {
  enum : int { max_tension, rewind_speed, restitution, width };
};

// Parts of a sample that a batch can save, in the order of the sample.
struct Part {
  enum : int {
    q_D, v_D, acc_D, q_K, v_K, acc_K, force, taut, books, slip, contact_residual, n
  };
};

// How many numbers a part has.
template <class Model>
constexpr int part_width(int part) {
  const int widths[] = {
      Model::n_qD, Model::n_vD, Model::n_vD, Model::n_qK, Model::n_vK, Model::n_vK,
      Model::n_rows, Model::n_rows, 7, Model::n_strings, 1};
  return widths[part];
}

// The generated functions. A single result is written to the last argument; several are written to
// the members of their names (arrays, pointers or numbers) of `to`. With `constants` false, entries
// that never change keep what an earlier call with `constants` wrote.
template <class Model, class Real>
struct Call {
  // Accelerations and tensions of any active set (Eqs. 10, 11): acc_D = back(L, w0 + W lam),
  // hddot = gamma + a0 + G lam, lam = -tension.
  template <class Results>
  FAN_FN static void dynamics(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* acc_K, const Real* u_D, const Real* p, Results& to, bool constants) {
    const Real* arg[] = {q_D, v_D, q_K, v_K, acc_K, u_D, p};
    Real* res[] = {at(to.L), at(to.w0), at(to.W), at(to.G), at(to.h), at(to.hdot), at(to.gamma),
        at(to.a0), at(to.hdot_K), at(to.h_limit), at(to.J_limit), at(to.gamma_limit),
        at(to.power0), at(to.M_DK_v_K), at(to.loss)};
    if (constants) Model::dynamics_constants(res);
    Model::dynamics_varying(arg, res);
  }

  // The same over a step dt: damping and drag are in F, velocity products those of v_ahead.
  template <class Results>
  FAN_FN static void step_dynamics(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* acc_K, const Real* u_D, const Real* v_ahead, const Real& dt,
      const Real* p, Results& to, bool constants) {
    const Real* arg[] = {q_D, v_D, q_K, v_K, acc_K, u_D, v_ahead, &dt, p};
    Real* res[] = {at(to.L), at(to.w0), at(to.W), at(to.G), at(to.h), at(to.hdot), at(to.a0),
        at(to.hdot_K), at(to.h_limit), at(to.J_limit), at(to.power0), at(to.M_DK_v_K),
        at(to.loss), at(to.f_M), at(to.y_M)};
    if (constants) Model::step_dynamics_constants(res);
    Model::step_dynamics_varying(arg, res);
  }

  // hdot of the limits at a velocity.
  FAN_FN static void limit_rates(
      const Real* J_limit, const Real* v_D, Real* rates) {
    const Real* arg[] = {J_limit, v_D};
    Real* res[] = {at(rates)};
    Model::limit_rates(arg, res);
  }

  // h of strings and limits, for compiled code.
  FAN_FN static void rows(
      const Real* q_D, const Real* q_K, const Real* p, Real* h) {
    const Real* arg[] = {q_D, q_K, p};
    Real* res[] = {at(h)};
    Model::rows(arg, res);
  }

  // Kinetic energy (Eq. 5) and potential energy (Eq. 6, and springs).
  template <class Results>
  FAN_FN static void energy(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* p, Results& to) {
    const Real* arg[] = {q_D, v_D, q_K, v_K, p};
    Real* res[] = {at(to.T), at(to.V)};
    Model::energy(arg, res);
  }

  // Momentum of all links about their centre of mass, in world axes.
  FAN_FN static void momentum(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* p, Real* momentum) {
    const Real* arg[] = {q_D, v_D, q_K, v_K, p};
    Real* res[] = {at(momentum)};
    Model::momentum(arg, res);
  }

  // Force on every driven coordinate: M_KD acc_D + M_KK acc_K + c_K - A_K^T lam.
  FAN_FN static void effort(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* acc_D, const Real* acc_K, const Real* lam, const Real* p,
      Real* f_K) {
    const Real* arg[] = {q_D, v_D, q_K, v_K, acc_D, acc_K, lam, p};
    Real* res[] = {at(f_K)};
    Model::effort(arg, res);
  }

  // User forces u_D of Eq. 8 from a wrench on every link.
  FAN_FN static void wrench_forces(
      const Real* q_D, const Real* q_K, const Real* wrench, const Real* p, Real* u_D) {
    const Real* arg[] = {q_D, q_K, wrench, p};
    Real* res[] = {at(u_D)};
    Model::wrench_forces(arg, res);
  }

  // World pose of every link (Eqs. 2, 3).
  FAN_FN static void poses(
      const Real* q_D, const Real* q_K, const Real* p, Real* poses) {
    const Real* arg[] = {q_D, q_K, p};
    Real* res[] = {at(poses)};
    Model::poses(arg, res);
  }

  // World positions of the points of every string's path.
  FAN_FN static void points(
      const Real* q_D, const Real* q_K, const Real* p, Real* points) {
    const Real* arg[] = {q_D, q_K, p};
    Real* res[] = {at(points)};
    Model::points(arg, res);
  }

  // Poses of all links, and the twist about the world's origin that a unit velocity gives all
  // links beyond its joint.
  template <class Results>
  FAN_FN static void screws(
      const Real* q_D, const Real* q_K, const Real* p, Results& to) {
    const Real* arg[] = {q_D, q_K, p};
    Real* res[] = {at(to.poses), at(to.screw_D), at(to.screw_K)};
    Model::screws(arg, res);
  }

  // y = F^-T x.
  FAN_FN static void forth(
      const Real* L, const Real* x, Real* y) {
    const Real* arg[] = {L, x};
    Real* res[] = {at(y)};
    Model::forth(arg, res);
  }

  // y = F^-1 x.
  FAN_FN static void back(
      const Real* L, const Real* x, Real* y) {
    const Real* arg[] = {L, x};
    Real* res[] = {at(y)};
    Model::back(arg, res);
  }

  // Lag of the drives that may be too weak.
  template <class Results>
  FAN_FN static void motor_lags(
      const Real* q_D, const Real* q_K, const Real* p, Results& to) {
    const Real* arg[] = {q_D, q_K, p};
    Real* res[] = {at(to.at), at(to.command), at(to.lag)};
    Model::motor_lags(arg, res);
  }

  // Share of the force its controller asks for that a motor can exert.
  FAN_FN static void motor_shares(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* acc_K, const Real* p, Real* share) {
    const Real* arg[] = {q_D, v_D, q_K, v_K, acc_K, p};
    Real* res[] = {at(share)};
    Model::motor_shares(arg, res);
  }

  // Force that controllers ask motors for, whatever these can exert.
  FAN_FN static void motor_demands(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* acc_K, const Real* p, Real* f_D) {
    const Real* arg[] = {q_D, v_D, q_K, v_K, acc_K, p};
    Real* res[] = {at(f_D)};
    Model::motor_demands(arg, res);
  }

  // Dynamics at a node of a variational run, and the factor with damping over dt.
  template <class Results>
  FAN_FN static void node(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* acc_K, const Real* u_D, const Real& dt, const Real* p,
      Results& to, bool constants) {
    const Real* arg[] = {q_D, v_D, q_K, v_K, acc_K, u_D, &dt, p};
    Real* res[] = {at(to.L), at(to.w0), at(to.W), at(to.G), at(to.h), at(to.hdot), at(to.a0),
        at(to.hdot_K), at(to.h_limit), at(to.J_limit), at(to.power0), at(to.M_DK_v_K),
        at(to.loss), at(to.L_firm), at(to.W_firm), at(to.G_firm)};
    if (constants) Model::node_constants(res);
    Model::node_varying(arg, res);
  }

  // The momenta at both ends of a step by the midpoint rule.
  template <class Results>
  FAN_FN static void midpoint_rule(
      const Real* q_D, const Real* xi, const Real* q_mid, const Real* v_mid,
      const Real* acc_mid, const Real* q_K, const Real* u_D, const Real& dt,
      const Real* p, Results& to) {
    const Real* arg[] = {q_D, xi, q_mid, v_mid, acc_mid, q_K, u_D, &dt, p};
    Real* res[] = {at(to.before), at(to.after), at(to.q_next), at(to.h), at(to.work_M)};
    Model::midpoint_rule(arg, res);
  }

  // p_D = M_DD v_D + M_DK v_K.
  FAN_FN static void momenta(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* p, Real* p_D) {
    const Real* arg[] = {q_D, v_D, q_K, v_K, p};
    Real* res[] = {at(p_D)};
    Model::momenta(arg, res);
  }

  // Derivative of Eq. 10's residual r by the dynamic configuration.
  FAN_FN static void force_by_q(
      const Real* q_D, const Real* v_D, const Real* acc_D, const Real* q_K,
      const Real* v_K, const Real* acc_K, const Real* tension, const Real& dt,
      const Real* p, Real* r_q, bool constants) {
    const Real* arg[] = {q_D, v_D, acc_D, q_K, v_K, acc_K, tension, &dt, p};
    Real* res[] = {at(r_q)};
    if (constants) Model::force_by_q_constants(res);
    Model::force_by_q_varying(arg, res);
  }

  // Derivative of r by the dynamic velocity.
  FAN_FN static void force_by_v(
      const Real* q_D, const Real* v_D, const Real* acc_D, const Real* q_K,
      const Real* v_K, const Real* acc_K, const Real* tension, const Real& dt,
      const Real* p, Real* r_v, bool constants) {
    const Real* arg[] = {q_D, v_D, acc_D, q_K, v_K, acc_K, tension, &dt, p};
    Real* res[] = {at(r_v)};
    if (constants) Model::force_by_v_constants(res);
    Model::force_by_v_varying(arg, res);
  }

  // Derivatives of r by the driven coordinates and the parameters.
  template <class Results>
  FAN_FN static void force_by_K(
      const Real* q_D, const Real* v_D, const Real* acc_D, const Real* q_K,
      const Real* v_K, const Real* acc_K, const Real* tension, const Real& dt,
      const Real* p, Results& to, bool constants) {
    const Real* arg[] = {q_D, v_D, acc_D, q_K, v_K, acc_K, tension, &dt, p};
    Real* res[] = {at(to.r_qK), at(to.r_vK), at(to.M_DK), at(to.r_p)};
    if (constants) Model::force_by_K_constants(res);
    Model::force_by_K_varying(arg, res);
  }

  // A_D, A_K and the derivatives of h, hdot and hddot of strings and limits.
  template <class Results>
  FAN_FN static void rows_by(
      const Real* q_D, const Real* v_D, const Real* acc_D, const Real* q_K,
      const Real* v_K, const Real* acc_K, const Real* p, Results& to, bool constants) {
    const Real* arg[] = {q_D, v_D, acc_D, q_K, v_K, acc_K, p};
    Real* res[] = {at(to.A_D), at(to.A_K), at(to.h_p), at(to.hdot_q), at(to.hdot_qK),
        at(to.hdot_p), at(to.hddot_q), at(to.hddot_v), at(to.hddot_qK),
        at(to.hddot_vK), at(to.hddot_p)};
    if (constants) Model::rows_by_constants(res);
    Model::rows_by_varying(arg, res);
  }

  // A_D, A_K and the derivatives of h and hdot of strings and limits.
  template <class Results>
  FAN_FN static void row_rates_by(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* p, Results& to, bool constants) {
    const Real* arg[] = {q_D, v_D, q_K, v_K, p};
    Real* res[] = {at(to.A_D), at(to.A_K), at(to.h_p), at(to.hdot_q), at(to.hdot_qK),
        at(to.hdot_p)};
    if (constants) Model::row_rates_by_constants(res);
    Model::row_rates_by_varying(arg, res);
  }

  // Forces that do not balance at rest, r of Eq. 10, h, and their derivatives.
  template <class Results>
  FAN_FN static void hanging(
      const Real* q_D, const Real* q_K, const Real* tension, const Real* p,
      Results& to) {
    const Real* arg[] = {q_D, q_K, tension, p};
    Real* res[] = {at(to.r), at(to.h), at(to.r_q), at(to.r_qK), at(to.r_p), at(to.A_D),
        at(to.A_K), at(to.h_p)};
    Model::hanging(arg, res);
  }

  // Gradient of z . r + y . hdot + y_h . h; r has the velocity products of v_ahead, hdot is at
  // v_next.
  template <class Results>
  FAN_FN static void step_back(
      const Real* q_D, const Real* v_D, const Real* v_ahead, const Real* v_next,
      const Real* acc_D, const Real* q_K, const Real* v_K, const Real* acc_K,
      const Real* tension, const Real* z, const Real* y, const Real* y_h,
      const Real& dt, const Real* p, Results& to) {
    const Real* arg[] = {q_D, v_D, v_ahead, v_next, acc_D, q_K, v_K, acc_K, tension, z, y, y_h, &dt, p};
    Real* res[] = {at(to.g_q), at(to.g_v), at(to.g_ahead), at(to.g_next), at(to.g_qK),
        at(to.g_vK), at(to.g_aK), at(to.g_p)};
    Model::step_back(arg, res);
  }

  // The entries of y = F^-T x that are not zero for x in one joint, by its number.
  FAN_FN static void column(
      int which, const Real* L, const Real* x_joint, Real* y) {
    const Real* arg[] = {L, x_joint};
    Real* res[] = {at(y)};
    Model::column(which, arg, res);
  }

 private:
  FAN_FN static Real* at(Real* x) { return x; }
  FAN_FN static Real* at(Real& x) { return &x; }
};

}  // namespace fan
