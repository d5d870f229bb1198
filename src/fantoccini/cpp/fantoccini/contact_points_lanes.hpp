// Contact points of a bundle of lanes: the links' motion, the balls around their solids, the test
// whether lists of near pairs still hold, and the rows of A_D in all lanes at once. Pairs that are
// near are looked at lane by lane, which places only their links.
#pragma once

#include "contact_points.hpp"

namespace fan {

template <class Model, class Real>
class ContactPointsLanes : public ContactPoints<Model, Real> {
  using Points = ContactPoints<Model, Real>;

 public:
  using Points::C, Points::N, Points::width, Points::n, Points::most, Points::point, Points::row;
  using Points::rate_K, Points::moved;
  using typename Points::Mask, typename Points::Tolerance;

  // Takes the solids; nothing is known of where they are.
  FAN_FN void begin(const ContactArrays& in) {
    Points::begin(in);
    known_ = Real(0.0) > Real(1.0);
  }

  // As ContactPoints::find().
  FAN_FN void find(
      const ContactArrays& in, const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* p, double dt, const Mask& idle) {
    Call<Model, Real>::screws(q_D, q_K, p, links_);
    most = 0;
    passing_within_ = 0.0;
    move_all(v_D, v_K);
    place_all();
    const Mask good = known_ && hold(dt);
    for (int l = 0; l < width; ++l) {
      n[l] = 0;
      if (lane_of(idle, l)) continue;
      if (lane_of(good, l)) {
        near_[l].serve();
        look_at_listed(in, dt, l);
      } else {
        load(l, v_D, v_K);
        move();
        place();
        this->look_at_near(in, dt, l);
        learn(l);
      }
      if (n[l] > most) most = n[l];
    }
    for (int i = 0; i < most; ++i) {
      this->clear(i);
      fill_all(in, i, v_K);
    }
  }

 private:
  using Points::L, Points::NK, Points::links_, Points::near_, Points::reach_, Points::around_;
  using Points::speed_at_start_, Points::passing_within_, Points::slack_, Points::is_placed_;
  using Points::lane_, Points::poses_, Points::has_solids, Points::load, Points::move, Points::place;

  // As PlacedLinks::move().
  FAN_FN void move_all(const Real* v_D, const Real* v_K) {
    for (int i = 0; i < L; ++i) {
      const int up = Model::link_parent[i];
      Real* to = twist_of_ + 6 * i;
      for (int c = 0; c < 6; ++c) to[c] = up < 0 ? Real(0.0) : twist_of_[6 * up + c];
      const auto add = [&](const int* begin, const int* entry, const Real* screw, const Real* v) {
        const int carried = up < 0 ? 0 : begin[up + 1] - begin[up];
        for (int j = begin[i] + carried; j < begin[i + 1]; ++j) {
          const Real *of = screw + 6 * entry[j], &speed = v[entry[j]];
          FAN_UNROLL for (int c = 0; c < 6; ++c) to[c] += of[c] * speed;
        }
      };
      add(Model::moved_D_begin, Model::moved_D_entry, links_.screw_D, v_D);
      add(Model::moved_K_begin, Model::moved_K_entry, links_.screw_K, v_K);
    }
  }

  // As PlacedLinks::place().
  FAN_FN void place_all() {
    using std::sqrt;
    for (int link = 0; link < L; ++link) {
      speed_at_start_[link] = Real(0.0);
      if (!has_solids(link)) continue;
      const Real *R = links_.poses + 12 * link, *t = twist_of_ + 6 * link;
      const double* own = around_[link].at;
      Real *at = centre_ + 3 * link, v[3];
      FAN_UNROLL for (int c = 0; c < 3; ++c)
        at[c] = R[9 + c] + R[c] * own[0] + R[3 + c] * own[1] + R[6 + c] * own[2];
      cross(t + 3, at, v);
      FAN_UNROLL for (int c = 0; c < 3; ++c) v[c] += t[c];
      speed_at_start_[link] = sqrt(dot3(v, v)) + sqrt(dot3(t + 3, t + 3)) * around_[link].radius;
    }
  }

  // As NearPairs::holds(): the lanes whose lists are still good.
  FAN_FN Mask hold(double dt) const {
    Mask all = Real(0.0) < Real(1.0);
    for (int link = 0; link < L; ++link) {
      if (!has_solids(link)) continue;
      const Real left = (0.5 * slack_ - 0.5 * Tolerance::margin) -
                        Tolerance::travel * dt * speed_at_start_[link];
      const Real *R = links_.poses + 12 * link, *old = old_ + 12 * link;
      Real turned = Real(0.0), moved_by = Real(0.0);
      FAN_UNROLL for (int k = 0; k < 9; ++k) turned += (R[k] - old[k]) * (R[k] - old[k]);
      FAN_UNROLL for (int c = 0; c < 3; ++c) {
        const Real by = centre_[3 * link + c] - old[9 + c];
        moved_by += by * by;
      }
      const double radius = around_[link].radius;
      const Real square = 2.0 * (moved_by + radius * radius * turned);
      all = all && left > Real(0.0) && square < left * left;
    }
    return all;
  }

  // Takes what lane l's list of near pairs knows.
  FAN_FN void learn(int l) {
    Real has = select(known_, Real(1.0), Real(0.0));
    lane_of(has, l) = near_[l].is_known() ? 1.0 : 0.0;
    known_ = has > Real(0.5);
    for (int link = 0; link < L && near_[l].is_known(); ++link) {
      if (!has_solids(link)) continue;
      for (int k = 0; k < 9; ++k) lane_of(old_[12 * link + k], l) = near_[l].turned(link)[k];
      for (int c = 0; c < 3; ++c) lane_of(old_[12 * link + 9 + c], l) = near_[l].centre(link)[c];
    }
  }

  // Finds the points of lane l among the pairs of its list.
  FAN_FN void look_at_listed(const ContactArrays& in, double dt, int l) {
    const auto& near = near_[l];
    for (int i = 0; i < L; ++i) is_placed_[i] = false;
    poses_ = lane_;
    const auto ready = [&](int link) {
      if (is_placed_[link]) return;
      for (int k = 12 * link; k < 12 * (link + 1); ++k) lane_[k] = lane_of(links_.poses[k], l);
      this->place_link(in, link);
    };
    for (int j = 0; j < near.n; ++j) {
      const int k = near.pair[j], a = in.solids[in.pairs[2 * k]].link;
      const int b = in.solids[in.pairs[2 * k + 1]].link;
      ready(a);
      if (b >= 0) ready(b);
      double speed = lane_of(speed_at_start_[a], l);
      if (b >= 0) speed += lane_of(speed_at_start_[b], l);
      this->look_at_placed(in, k, Tolerance::margin + Tolerance::travel * dt * speed, l);
    }
  }

  // The rows of point i of all lanes: first what moves the first bodies, then the second ones.
  FAN_FN void fill_all(const ContactArrays& in, int i, const Real* v_K) {
    Real at[3], frame[9], sign[2][width];
    int link[2][width], n_links[2] = {};
    for (int k = 0; k < 3; ++k) at[k] = Real(0.0);
    for (int k = 0; k < 9; ++k) frame[k] = Real(0.0);
    for (int l = 0; l < width; ++l) {
      if (i >= n[l]) continue;
      const auto& from = point[l][i];
      for (int k = 0; k < 3; ++k) lane_of(at[k], l) = from.at[k];
      for (int k = 0; k < 9; ++k) lane_of(frame[k], l) = from.frame[k];
      for (int side = 0; side < 2; ++side) {
        const int which = in.solids[in.pairs[2 * from.pair + side]].link;
        if (which < 0) continue;
        int& known = n_links[side];
        int j = 0;
        while (j < known && link[side][j] != which) ++j;
        if (j == known) {
          link[side][known++] = which;
          sign[side][j] = Real(0.0);
        }
        lane_of(sign[side][j], l) = side ? 1.0 : -1.0;
      }
    }
    for (int side = 0; side < 2; ++side)
      for (int j = 0; j < n_links[side]; ++j)
        add_link(i, link[side][j], sign[side][j], at, frame, v_K);
  }

  FAN_FN void add_link(
      int i, int link, const Real& sign, const Real* at, const Real* frame, const Real* v_K) {
    const int *begin = Model::moved_D_begin + link, *entry = Model::moved_D_entry;
    moved[i].add(link, entry + begin[0], entry + begin[1]);
    const auto add = [&](const Real* s, const Real& by, Triple<Real>& to) {
      Real v[3];
      cross(s + 3, at, v);
      FAN_UNROLL for (int c = 0; c < 3; ++c) v[c] = by * (s[c] + v[c]);
      FAN_UNROLL for (int d = 0; d < 3; ++d) to.of[d] += dot3(frame + 3 * d, v);
    };
    for (int j = begin[0]; j < begin[1]; ++j)
      add(links_.screw_D + 6 * entry[j], sign, row[i][entry[j]]);
    for (int j = Model::moved_K_begin[link]; j < Model::moved_K_begin[link + 1]; ++j) {
      const int k = Model::moved_K_entry[j];
      add(links_.screw_K + 6 * k, sign * v_K[k], rate_K[i]);
    }
  }

  Real twist_of_[room(6 * L)], centre_[room(3 * L)];  // of the links and the balls around them
  Real old_[room(12 * L)];  // turns and centres at which the lists of near pairs were made
  Mask known_;              // lanes that have a list
};

}  // namespace fan
