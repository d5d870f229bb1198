// The contract between Python and compiled code, made by `python -m fantoccini.contract` from
// fantoccini/contract/*.py: change it there.
#pragma once

#include "real.hpp"

namespace fan {

// A hash of the contract.
constexpr long long contract_digest = 0x282a9767d312ca21;

// Who a library is, as Python checks when it loads it: the contract's hash, how many trajectories
// or configurations are advanced together, and the puppet's sizes.
template <class Sizes>
void identity(int width, long long* out) {
  const long long values[] = {
      contract_digest, width, Sizes::n_qD, Sizes::n_vD, Sizes::n_qK, Sizes::n_vK, Sizes::n_v,
      Sizes::n_strings, Sizes::n_limits, Sizes::n_rows, Sizes::n_p, Sizes::n_links,
      Sizes::n_points, Sizes::n_motors, Sizes::n_watched, Sizes::n_packed};
  for (long long value : values) *out++ = value;
}

// The generated functions. A result goes to its argument; several go to members of their names:
// arrays, pointers or numbers. Where `constants` is false, entries that are always the same are
// left as an earlier call with it has written them.
template <class Model, class Real>
struct Call {
  // All that the accelerations and tensions of any set of taut strings need (Eqs. 10, 11):
  // acc_D = back(L, w0 + W lam), hddot = gamma + a0 + G lam, lam = -tension.
  //   L (n_packed) numbers of the factor M = F^T F, for forth and back only
  //   w0 (n_vD) F^-T (u_D - c - damping - M_DK acc_K)
  //   W (n_vD, n_strings) F^-T A_D^T
  //   G (n_strings, n_strings) A_D M^-1 A_D^T = W^T W [1/kg]
  //   h (n_strings) path length minus string length [m]
  //   hdot (n_strings) its rate [m/s]
  //   gamma (n_strings) hddot at acc_D = 0 [m/s^2]
  //   a0 (n_strings) W^T w0 [m/s^2]
  //   hdot_K (n_strings) A_K v_K, the inputs' part of hdot [m/s]
  //   h_limit (n_limits) h of the limits
  //   J_limit (3, n_limits) their rows of A_D: the entries of their own joint
  //   gamma_limit (n_limits) hddot of the limits at acc_D = 0
  //   power0 power of the inputs at acc_D = 0 without tensions [W]
  //   M_DK_v_K (n_vD) M_DK v_K
  //   loss power of damping and drag [W]
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

  // The same for a step dt, with damping and drag over it in F and the velocity products of
  // v_ahead.
  //   L (n_packed) numbers of the factor M = F^T F, for forth and back only
  //   w0 (n_vD) F^-T (u_D - c - damping - M_DK acc_K)
  //   W (n_vD, n_strings) F^-T A_D^T
  //   G (n_strings, n_strings) A_D M^-1 A_D^T = W^T W [1/kg]
  //   h (n_strings) path length minus string length [m]
  //   hdot (n_strings) its rate [m/s]
  //   a0 (n_strings) W^T w0 [m/s^2]
  //   hdot_K (n_strings) A_K v_K, the inputs' part of hdot [m/s]
  //   h_limit (n_limits) h of the limits
  //   J_limit (3, n_limits) their rows of A_D: the entries of their own joint
  //   power0 power of the inputs at acc_D = 0 without tensions [W]
  //   M_DK_v_K (n_vD) M_DK v_K
  //   loss power of damping and drag [W]
  //   f_M (n_motors) the motors give f_M - y_M dv over the step [N or N m]
  //   y_M (n_motors) what they yield by a change dv of velocity
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
  // rates (n_limits) hdot of the limits [1/s].
  FAN_FN static void limit_rates(
      const Real* J_limit, const Real* v_D, Real* rates) {
    const Real* arg[] = {J_limit, v_D};
    Real* res[] = {at(rates)};
    Model::limit_rates(arg, res);
  }

  // h of strings and limits, for compiled code.
  // h (n_rows) path length minus string length; limits as listed [m].
  FAN_FN static void rows(
      const Real* q_D, const Real* q_K, const Real* p, Real* h) {
    const Real* arg[] = {q_D, q_K, p};
    Real* res[] = {at(h)};
    Model::rows(arg, res);
  }

  // Kinetic energy (Eq. 5) and potential energy (Eq. 6, and springs).
  //   T kinetic energy [J]
  //   V potential energy [J]
  template <class Results>
  FAN_FN static void energy(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* p, Results& to) {
    const Real* arg[] = {q_D, v_D, q_K, v_K, p};
    Real* res[] = {at(to.T), at(to.V)};
    Model::energy(arg, res);
  }

  // Force on every driven coordinate: M_KD acc_D + M_KK acc_K + c_K - A_K^T lam.
  // f_K (n_vK) force; of a command that of the motor it has [N or N m].
  FAN_FN static void effort(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* acc_D, const Real* acc_K, const Real* lam, const Real* p,
      Real* f_K) {
    const Real* arg[] = {q_D, v_D, q_K, v_K, acc_D, acc_K, lam, p};
    Real* res[] = {at(f_K)};
    Model::effort(arg, res);
  }

  // u_D of Eq. 8 from a wrench on every link.
  // u_D (n_vD) user forces that do the same [N or N m].
  FAN_FN static void wrench_forces(
      const Real* q_D, const Real* q_K, const Real* wrench, const Real* p, Real* u_D) {
    const Real* arg[] = {q_D, q_K, wrench, p};
    Real* res[] = {at(u_D)};
    Model::wrench_forces(arg, res);
  }

  // World pose of every link (Eqs. 2, 3).
  // poses (12, n_links) R column by column, then the origin [1, m].
  FAN_FN static void poses(
      const Real* q_D, const Real* q_K, const Real* p, Real* poses) {
    const Real* arg[] = {q_D, q_K, p};
    Real* res[] = {at(poses)};
    Model::poses(arg, res);
  }

  // World positions of the points each string runs through.
  // points (3, n_points) x, y, z [m].
  FAN_FN static void points(
      const Real* q_D, const Real* q_K, const Real* p, Real* points) {
    const Real* arg[] = {q_D, q_K, p};
    Real* res[] = {at(points)};
    Model::points(arg, res);
  }

  // y = F^-T x.
  // y (n_vD) the solution.
  FAN_FN static void forth(
      const Real* L, const Real* x, Real* y) {
    const Real* arg[] = {L, x};
    Real* res[] = {at(y)};
    Model::forth(arg, res);
  }

  // y = F^-1 x.
  // y (n_vD) the solution.
  FAN_FN static void back(
      const Real* L, const Real* x, Real* y) {
    const Real* arg[] = {L, x};
    Real* res[] = {at(y)};
    Model::back(arg, res);
  }

  // How far drives that may be too weak are from their commands.
  //   at (n_watched) where the drive is [rad or m]
  //   told (n_watched) where its command wants it [rad or m]
  //   lag (n_watched) lag in periods of a stepper [1]
  template <class Results>
  FAN_FN static void motor_lags(
      const Real* q_D, const Real* q_K, const Real* p, Results& to) {
    const Real* arg[] = {q_D, q_K, p};
    Real* res[] = {at(to.at), at(to.told), at(to.lag)};
    Model::motor_lags(arg, res);
  }

  // How much of what its command asks a motor can give.
  // share (n_watched) what it can give, relative to what is asked [1].
  FAN_FN static void motor_shares(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* acc_K, const Real* p, Real* share) {
    const Real* arg[] = {q_D, v_D, q_K, v_K, acc_K, p};
    Real* res[] = {at(share)};
    Model::motor_shares(arg, res);
  }

  // dynamics at a node of a variational run, and the factor with damping over dt.
  //   L (n_packed) numbers of the factor M = F^T F, for forth and back only
  //   w0 (n_vD) F^-T (u_D - c - damping - M_DK acc_K)
  //   W (n_vD, n_strings) F^-T A_D^T
  //   G (n_strings, n_strings) A_D M^-1 A_D^T = W^T W [1/kg]
  //   h (n_strings) path length minus string length [m]
  //   hdot (n_strings) its rate [m/s]
  //   a0 (n_strings) W^T w0 [m/s^2]
  //   hdot_K (n_strings) A_K v_K, the inputs' part of hdot [m/s]
  //   h_limit (n_limits) h of the limits
  //   J_limit (3, n_limits) their rows of A_D: the entries of their own joint
  //   power0 power of the inputs at acc_D = 0 without tensions [W]
  //   M_DK_v_K (n_vD) M_DK v_K
  //   loss power of damping and drag [W]
  //   L_firm (n_packed) L with damping and drag over dt in it
  //   W_firm (n_vD, n_strings) W of that factor
  //   G_firm (n_strings, n_strings) G of that factor [1/kg]
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
  //   before (n_vD) momentum p_k(xi) at the step's start
  //   after (n_vD) momentum p_k+1 at its end
  //   q_next (n_qD) configuration q_k+1
  //   h (n_rows) h of all rows there [m]
  //   work_M work of the motors [J]
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
  // p_D (n_vD) momenta of the dynamic coordinates.
  FAN_FN static void momentum(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* p, Real* p_D) {
    const Real* arg[] = {q_D, v_D, q_K, v_K, p};
    Real* res[] = {at(p_D)};
    Model::momentum(arg, res);
  }

  // The entries of y = F^-T x that are not zero for x in one joint, by its number.
  // y (n_vD) these entries, side by side.
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
