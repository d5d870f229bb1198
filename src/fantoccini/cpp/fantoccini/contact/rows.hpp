// The rows of A_D at contact points:
//
//   u = e . (v_A + w_A x P - v_B - w_B x P),   e the normal and two tangents at the point P
//
// with (v, w) a link's twist about the world's origin, the sum of the screws of the velocities that
// move it. Rows have the sign of h, like those of strings: hdot = -u, so that h = -gap <= 0 where
// solids do not overlap, and a force x >= 0 pushes A along +e and B along -e. Of one trajectory, rows
// are written where they are asked for; hdot comes from the links' twists.
#pragma once

#include "fantoccini/collision/placed_links.hpp"
#include "fantoccini/contact/moved_by.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Model, class Real>
class ContactRows : public PlacedLinks<Model, Real> {
  using Links = PlacedLinks<Model, Real>;

 public:
  static constexpr int C = Model::n_contacts, N = Links::N, width = Links::width;

  struct Point {
    int pair, feature, region;  // of ContactArrays; which of the pair's points; of Touch
    double gap, at[3];       // m
    double frame[9];         // normal, tangent, tangent
    int before;              // which of those that pushed in the step before; -1 for none
    bool carried, slid;      // whether any of its pair did, and, in lanes, moved across the normal
  };

  int n[width], most;        // points of each lane, and of the one that has most
  Point point[width][room(C)];
  Triple<Real> row[room(C)][room(N)];  // of A_D: every point's normal and tangents
  Triple<Real> rate_K[room(C)];        // A_K v_K of these rows
  MovedBy<N> moved[room(C)];                // where a point's rows may differ from zero

  // Whether there is a point i in a lane.
  FAN_FN bool has(int l, int i) const {
    return i < n[l];
  }

  // hdot of points at velocities v_D.
  class Rates {
   public:
    FAN_FN Rates(const ContactRows& of, const Real* v_D) : of_(of), v_D_(v_D) {
      for (bool& known : is_known_) known = false;
    }

    FAN_FN Triple<Real> operator()(int i) {
      Triple<Real> out = change(i);
      out.add(Real(1.0), of_.rate_K[i]);
      return out;
    }

    // Without what drives the solids: by a change of velocity.
    FAN_FN Triple<Real> change(int i) {
      Triple<Real> out;
      out.clear();
      for (int side = 0; side < 2; ++side) {
        const int link = of_.link_[i][side];
        if (link < 0) continue;
        if (!is_known_[link]) of_.turn(link, v_D_, twist_[link]);
        is_known_[link] = true;
        const auto& by = twist_[link];
        out.add(side ? 1.0 : -1.0, {of_.form_[i].speed(by.linear, by.angular)});
      }
      return out;
    }

   private:
    const ContactRows& of_;
    const Real* v_D_;
    typename Links::Twist twist_[room(Links::L)];  // of the links that were asked for
    bool is_known_[room(Links::L)];
  };

  // hdot of point i at the velocities that it was found at.
  FAN_FN Triple<Real> rate(int i, const Real* v_D) const {
    Triple<Real> out;
    out.clear();
    for (int side = 0; side < 2; ++side) {
      const int link = link_[i][side];
      if (link >= 0)
        out.add(side ? 1.0 : -1.0, {form_[i].speed(twist_[link].linear, twist_[link].angular)});
    }
    return out;
  }

  // The links of a point's solids; -1 for the world. Of one trajectory.
  FAN_FN const int* links(int i) const { return link_[i]; }

  // Writes point i's row if it is not there.
  FAN_FN void need_row(const ContactArrays& in, int i) {
    if (is_written_[i]) return;
    is_written_[i] = true;
    write(in, 0, point[0][i].pair, form_[i], moved[i], row[i]);
  }

  // The rows of three directions at a point of a pair, and those that turn about them, in metres of
  // `size`. Of one trajectory.
  FAN_FN void write_rows(
      const ContactArrays& in, int pair, const double* at, const double* frame,
      const MovedBy<N>& by, Triple<Real>* out) const {
    write(in, 0, pair, Form(frame, at), by, out);
  }

  FAN_FN void write_turns(
      const ContactArrays& in, int pair, const double* frame, double size, const MovedBy<N>& by,
      Triple<Real>* out) const {
    write(in, 0, pair, Form(frame, size), by, out);
  }

 protected:
  using Links::links_, Links::twist_, Links::screw_D_, Links::screw_K_, Links::v_K_;

  // The three directions' parts along each axis, and about it.
  struct Form {
    Quad of[3], about[3];

    Form() = default;
    // Of the velocity at a point.
    FAN_FN Form(const double* e, const double* at) {
      FAN_UNROLL for (int c = 0; c < 3; ++c) of[c] = Quad{e[c], e[3 + c], e[6 + c], 0.0};
      FAN_UNROLL for (int c = 0; c < 3; ++c)
        about[c] = at[(c + 1) % 3] * of[(c + 2) % 3] - at[(c + 2) % 3] * of[(c + 1) % 3];
    }
    // Of a turn.
    FAN_FN Form(const double* e, double size) {
      FAN_UNROLL for (int c = 0; c < 3; ++c) {
        of[c] = Quad{};
        about[c] = size * Quad{e[c], e[3 + c], e[6 + c], 0.0};
      }
    }

    // By a velocity and an angular one.
    FAN_FN Quad speed(const double* v, const double* w) const {
      return (of[0] * v[0] + of[1] * v[1] + of[2] * v[2]) +
             (about[0] * w[0] + about[1] * w[1] + about[2] * w[2]);
    }
  };

  FAN_FN void clear(int i) {
    moved[i].clear();
    rate_K[i].clear();
    is_written_[i] = false;
  }

  FAN_FN static void clear_row(Triple<Real>* out) {
    for (int k = 0; k < N; ++k) out[k].clear();
  }

  // What moves lane l's point i.
  FAN_FN void fill(const ContactArrays& in, int l, int i) {
    const Point& from = point[l][i];
    const Form& form = form_[i] = Form(from.frame, from.at);
    for (int side = 0; side < 2; ++side) {
      const int link = link_[i][side] = in.solids[in.pairs[2 * from.pair + side]].link;
      if (link < 0) continue;
      const int *begin = Model::moved_D_begin + link, *entry = Model::moved_D_entry;
      moved[i].add(link, entry + begin[0], entry + begin[1]);
      for (int j = Model::moved_K_begin[link]; j < Model::moved_K_begin[link + 1]; ++j) {
        const double* s = screw_K_ + 6 * Model::moved_K_entry[j];
        const double speed = v_K_[Model::moved_K_entry[j]];
        rate_K[i].add_in(l, side ? speed : -speed, form.speed(s, s + 3));
      }
    }
  }

 private:
  // The twist of a link.
  FAN_FN void turn(int link, const double* v_D, typename Links::Twist& out) const {
    Quad linear{}, angular{};
    for (int j = Model::moved_D_begin[link]; j < Model::moved_D_begin[link + 1]; ++j) {
      const int k = Model::moved_D_entry[j];
      linear += v_D[k] * quad(screw_D_ + 6 * k);
      angular += v_D[k] * quad(screw_D_ + 6 * k + 3);
    }
    quad(out.linear) = linear;
    quad(out.angular) = angular;
  }

  // Adds the rows of a pair in lane l to `out`. Of one trajectory, only entries that move it are
  // written where its two links have none in common, and it need not be 0 before.
  FAN_FN void write(
      const ContactArrays& in, int l, int pair, const Form& form, const MovedBy<N>& by,
      Triple<Real>* out) const {
    const bool fresh = by.apart;
    if (!fresh) clear_row(out);
    for (int side = 0; side < 2; ++side) {
      const int link = in.solids[in.pairs[2 * pair + side]].link;
      if (link < 0) continue;
      for (int j = Model::moved_D_begin[link]; j < Model::moved_D_begin[link + 1]; ++j) {
        const int k = Model::moved_D_entry[j];
        const double* s = screw_D_ + 6 * k;
        if (fresh) out[k].clear();
        out[k].add_in(l, side ? 1.0 : -1.0, form.speed(s, s + 3));
      }
    }
  }

  // Of one trajectory.
  Form form_[room(C)];
  int link_[room(C)][2];
  bool is_written_[room(C)];
};

}  // namespace fan

FAN_LOOPS_END
