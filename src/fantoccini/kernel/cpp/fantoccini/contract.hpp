// The contract between Python and compiled code, generated from fantoccini/kernel/contract/*.py
// by `python -m fantoccini.kernel.contract`: make changes there.
#pragma once

#include "fantoccini/math/real.hpp"

namespace fan {

// A hash of the contract.
constexpr long long contract_digest = 0x5147527cc30c735a;

// Identity of a library, which Python checks when it loads it: the contract's hash, the number of
// trajectories or configurations that are advanced together, and the puppet's sizes.
template <class Sizes>
void identity(int width, long long* out) {
  const long long values[] = {
      contract_digest, width, Sizes::n_qD, Sizes::n_vD, Sizes::n_qK, Sizes::n_vK, Sizes::n_v,
      Sizes::n_strings, Sizes::n_limits, Sizes::n_rows, Sizes::n_p, Sizes::n_links,
      Sizes::n_points, Sizes::n_motors, Sizes::n_watched, Sizes::n_contacts,
      Sizes::n_solids, Sizes::n_packed};
  for (long long value : values) *out++ = value;
}

// Constants shared with Python.
struct Constants {
  // largest tension relative to the weight; above it, the input is impossible
  static constexpr double tension_cap = 100000.0;
  // largest -h of a closed row, relative to its string's length or to 1
  static constexpr double closed_gap = 5e-13;
  // largest -h of a row that a run's start sets to h = 0, likewise
  static constexpr double start_gap = 1e-09;
  // largest hdot of a closed row at rest, times the largest velocity if that is above 1 [m/s
  // or rad/s]
  static constexpr double rest_speed = 1e-05;
  // lower bound of the length by which a string's gap is divided [m]
  static constexpr double min_scale_length = 0.001;
  // deceleration of a rewinding winch before it stops [m/s^2]
  static constexpr double winch_deceleration = 1.0;
  // largest number of vertices of a polytope in contact
  static constexpr double hull_vertices = 128.0;
};

// End of a run, with a message. Compiled code has the same numbers (``contract.hpp``).
enum Status : int {
  DONE = 0,  // the run reached its end
  RUNNING = 1,  // the run has not reached its end yet
  IMPOSSIBLE_INPUT = 2,  // the inputs ask for a motion that no puppet on these strings can follow
  TENSION_CAP = 3,  // a tension exceeded the largest one that a string may have
  STEP_TOO_SMALL = 4,  // the step size fell below the rounding error of the time
  TOO_MANY_EVENTS = 5,  // strings came taut and slack more often than the limit on events
  TOO_MANY_STEPS = 6,  // the bound on the number of steps was reached
  NOT_FINITE = 7,  // a state or a force is no longer a finite number
  COLLAPSED = 8,  // two neighbouring points of a taut string came together
  LENGTH_NOT_POSITIVE = 9,  // a string's length was driven to zero or below
  PROJECTION_FAILED = 10,  // the strings could not be brought back to their lengths
  STOPPED = 11,  // the run was stopped from outside
  SINGULAR_MASS = 12,  // the mass matrix is singular: a joint moves no mass
  NOT_SETTLED = 13,  // the solution of a step's equations did not converge
  LOST_STEPS = 14,  // a stepper motor lost steps; the run continued to its end
  // a load moved a drive against the full torque of its motor or controller; the run ends
  // early if the drive moved too far
  RUNAWAY = 15,
  TOO_MANY_SAMPLES = 16,  // the samples of the run reached the bound on memory
  REDUNDANT_STRINGS = 17,  // the lengths of redundant strings are inconsistent
  OVERSTEPPED = 18,  // the run went on, but strings, limits or contacts were violated
  GAINED_ENERGY = 19,  // the run went on, but the fixed step made energy out of nothing
  TOO_MANY_CONTACTS = 20,  // more points touched at once than a step has room for
  NO_UNIQUE_MOTION = 21,  // friction jams (Painlevé): no finite contact force, or several
  UNBALANCED = 22,  // the run went on, but the energy balance of the fixed steps has a residual
  OUT_OF_TIME = 23,  // the time limit on computing ended the run
};

// Kind of an event.
enum EventCode : int {
  CATCH = 0,  // a slack string became taut, or a limit was reached
  RELEASE = 1,  // a string went slack, or a limit was left
  ACCUMULATION = 2,  // infinitely many catches were treated as one
  BREAKPOINT = 3,  // the inputs' acceleration may jump
  SLIP = 4,  // the winch began to slip
  GRIP = 5,  // the winch grips again
  LOST_STEP = 6,  // a stepper motor lost a step
  RAN_AWAY = 7,  // a drive ran away
  TOUCH = 8,  // two solids came into contact
  LIFT = 9,  // two solids separated
  STICK = 10,  // two solids that touch stopped sliding
  SLIDE = 11,  // two solids that touch began to slide
};

// Mode of a row between two events.
enum Hold : signed char {
  SLACK = 0,  // inactive, without force
  HELD = 1,  // active
  IDLE = 2,  // active without tension: linearly dependent on the held rows
  PINNED = 3,  // active at its winch's largest tension, linearly dependent
  SLIPPING = 4,  // pulls with its winch's largest tension while the winch slips
};

// Kinds of solids.
enum SolidKind : int {
  SEGMENT = 0,  // from a to b, inflated by the radius; if half[0] > 0, the ellipsoid in it
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

// Outcome of a complementarity solve.
enum class Solved : int {
  YES = 0,  // solved
  INFEASIBLE = 1,  // there is no solution
  UNSETTLED = 2,  // the bound on iterations was reached
  TOO_LARGE = 3,  // more rows than the puppet has, or not enough memory
};

// Outcome of a search for the hanging pose nearest to targets.
enum class ReachEnd : int {
  REACHED = 0,  // the targets are reached within the tolerance
  NEAREST = 1,  // no neighbouring hanging pose is nearer
  STALLED = 2,  // no step reduced the distance, or the bound on iterations was reached
  LOST = 3,  // there is no equilibrium at the start of the search
  TIPS = 4,  // nearer poses are not stable equilibria
};

// Reasons, as bits, why a step is not smooth; from LAW_CHANGED on it has no derivative.
enum StepEdge : int {
  WITHOUT_FORCE = 1,  // a point touches without force
  STRAINED = 2,  // a point sticks at the edge of its cone
  REBOUND_BEGINS = 4,  // a point would rebound if faster, or is not the only one that touches first
  NOT_SMOOTH = 8,  // the position of a point has no derivative
  SLIDES_ELSEWHERE = 16,  // a point touches without force, and slides in another direction
  // bodies are wedged in, restitution is scaled down to add no energy, or points rebound one
  // after the other
  LAW_CHANGED = 32,
  JAMS = 64,  // friction jams: no forces keep the modes
  OPEN_SHARES = 128,  // solids slide on so many points that their forces are not unique
  TOO_MANY_POINTS = 256,  // there are more points with force than a step allows
};

// An input: arrays in C order.
struct InputArrays {
  int n_segments;  // number of pieces
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
  double inner;  // radius of the largest ball about the origin in it [m]
  double outer;  // radius of the smallest ball about the origin around it [m]
  const double* vertices;  // (n_vertices, 3) [m]
  const double* planes;  // (n_facets, 4) outward unit normal; height above the origin [m]
  const int* begins;  // (n_facets + 1,) index of each facet's first corner
  const int* corners;  // vertices of each facet in turn, anticlockwise seen from outside
  const int* sides;  // edge from each corner to the next
  const int* edges;  // (n_edges, 4) two vertices, the facets to the left and right
  const int* around_begins;  // (n_vertices + 1,) index of each vertex's first facet
  const int* around;  // facets of each vertex in turn
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
  const Hull* hull;  // polytope of a HULL; otherwise null
};

// Solids that may touch, and the contact laws of their pairs.
struct ContactArrays {
  long long n_solids;
  long long n_pairs;
  long long n_groups;
  const Solid* solids;  // solids of the links, then solids fixed in the world
  const int* pairs;  // (n_pairs, 2) solids; the second may be fixed in the world
  // (n_groups, 3) groups of pairs of the same two links, or of a link and a fixed solid: first
  // link; second link, or -1 - the solid; end of its pairs
  const int* groups;
  const double* friction;  // (n_pairs,) coefficient of Coulomb's law
  const double* restitution;  // (n_pairs,) 0 to 1
  const int* meetings;  // (n_pairs,) first pair of parts with the same two names
};

// Options of a run.
struct Options {
  double rtol;  // relative tolerance of the event-driven integrator
  double atol;  // absolute tolerance, likewise
  double first_step;  // [s]
  double max_step;  // [s]
  double tension_cap;  // [N]; for limits [N m], for impulses [N s]
  double energy_scale;  // scale of work and loss integrals, for errors [J]
  double force_scale;  // scale of forces in coordinates with M_DD = 1
  double recovery_speed;  // largest speed at which time-stepping removes a violation [m/s]
  double dt;  // fixed step [s]
  long long max_steps;
  long long max_events;
  int save_steps;  // whether to save every accepted step
  int extrapolate;  // time-stepping: whether velocity products are half a step ahead
  const ContactArrays* contacts;  // null without contact; must outlive the run
};

// Memory for the samples and events of a run.
struct RecordArrays {
  double* samples;  // (sample_capacity, SampleLayout::width)
  long long sample_capacity;
  long long n_samples;  // number of samples written
  double* events;  // (event_capacity, EventLayout::width)
  long long event_capacity;
  long long n_events;  // number of events written
  double* contacts;  // (contact_capacity, ContactLayout::width)
  long long contact_capacity;
  long long n_contacts;  // number of contact points written
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

// Progress of a run.
struct RunProgress {
  long long steps;  // number of steps taken
  double t;  // time reached [s]
  double violation;  // largest violation of fixed steps so far [m or rad]
};

// An array for every trajectory, or one that all share.
struct Shared {
  const double* first;  // array of the first trajectory, or null
  long long stride;  // distance of neighbouring trajectories' arrays; 0 if shared
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
  double* attribution;  // (n, n_rows + n_watched)
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
  double* energy_terms;  // (n, 5) work, damping, impact, slip loss, friction; written [J]
  double* energy;  // (n, 2) kinetic and potential; written [J]
  double* violation;  // (n,) largest since it began; written
  double* advanced;  // (n,) time by which it was advanced in the piece; written [s]
  int* status;  // (n,) Status; written
  double* attribution;  // (n, n_rows + n_watched) shares in causing it; written
};

// A contact point with force in a fixed step, and its mode.
struct StepContact {
  int pair;  // index of the pair in ContactArrays
  int feature;  // index of the point among the pair's points
  int links[2];  // links of the two solids; -1 for the world
  int sticks;  // whether it sticks; otherwise it slides
  int turns;  // whether the direction of sliding turns with the velocity
  double friction;  // coefficient of friction
  double gap;  // distance of the solids [m]
  double closes;  // d(gap speed)/d(gap) required by the step [1/s]
  double bounces;  // restitution required by the step
  double at[3];  // position in the world [m]
  double normal[3];  // unit normal from the second solid to the first
  double force[3];  // force on the first solid [N]
  double velocity[3];  // velocity of the first solid relative to the second after the step [m/s]
  double along[3];  // direction of sliding; 0 if it sticks
  // (7, 6) derivatives of gap, position and normal by a twist of the first link about the
  // origin
  double by[42];
};

// First time steps with contact, one for each node.
struct TouchingStepArrays {
  Options options;
  const double* winches;  // winches of all nodes
  double reference_force;  // size of forces, such as the weight [N]
  int capacity;  // largest number of points of a node
  Shared p;
  Shared acc_K;  // driven acceleration at the start
  Shared u_D;  // user forces, or null
  const double* q_D;  // (n, n_qD) starts
  const double* v_D;  // (n, n_vD)
  const double* q_K;  // (n, n_qK)
  const double* v_K;  // (n, n_vK)
  double* slip;  // (n, n_strings) slip at the start; then after the step
  const double* rate;  // (n, n_vK) dq_K/dt over the step
  const double* mean;  // (n, n_vK) dv_K/dt over the step
  double* q_D_next;  // (n, n_qD) state after the step
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
  int n_pairs;  // number of pairs in ContactArrays
  int* pair_edges;  // (n, n_pairs) StepEdge of every pair; set to 0 before
  int* n_points;  // (n,) numbers of points with force
  StepContact* points;  // (n, capacity)
  double* screws;  // (n, n_vD + n_vK, 6) results of the function screws at the start
  // (n, n_links + n_vD + n_vK, 6, n_p) derivatives by the parameters: twists of links, changes
  // of screws; null without parameters
  double* by_p;
};

// Time steps and their derivatives, one for each node.
struct StepDerivativeArrays {
  double dt;  // length of all steps [s]
  double recovery_speed;  // recovery_speed of Options [m/s]
  int forces;  // whether to differentiate by u_D as well
  Shared p;
  Shared u_D;  // or null
  const double* q_D;  // (n, n_qD) starts
  const double* v_D;  // (n, n_vD)
  const double* q_K;  // (n, n_qK)
  const double* rate;  // (n, n_vK) dq_K/dt over the step
  const double* mean;  // (n, n_vK) dv_K/dt over the step
  const double* slip;  // (n, n_strings)
  const double* tension;  // (n, n_rows) tensions of the step
  const unsigned char* held;  // (n, n_rows) rows that the step holds
  const int* cap_by;  // (n_rows,) parameter that is the row's largest tension; -1 for none
  double* acc_D;  // (n, n_vD) mean acceleration over the step
  // (n, 2 n_vD, m) derivatives of (dq_D, v_D) after the step by q_D, v_D, q_K, v_K, acc_K, u_D
  // if requested, and p; for driven rotations by rate and mean
  double* motion;
  double* pull;  // (n, n_rows, m) derivatives of the tensions, or null
  // (n, 3 capacity, m) derivatives of the multipliers, point after point: along the normal
  // and, if the point sticks, along two tangents; or null
  double* shares;
  // (n, n_vD + n_vK, m) of the configuration where what springs back touches, of steps in
  // which something does; null without shares
  double* moved;
  const int* n_points;  // (n,) points that push; null without contact
  const double* delay;  // as in TouchingStepArrays; null without contact
  int capacity;  // for points of a node
  const StepContact* points;  // (n, capacity)
  const double* screws;  // screws of TouchingStepArrays
  const double* by_p;  // by_p of TouchingStepArrays
  int* edges;  // (n,) StepEdge; bits are added
};

// A smooth piece of a run, and the evolution of small changes along it.
struct FlowDerivativeArrays {
  double rtol;  // relative tolerance of the integration of state and changes
  double atol;  // absolute tolerance, likewise
  double step;  // first step size; at the end, the next step size [s]
  double start;  // time of the start [s]
  long long n_times;
  const double* times;  // (n_times,) times of results, increasing; the last is the end [s]
  InputArrays input;  // input with one piece
  int m;  // number of changes: of the state, of parameters, of the inputs
  int n_inputs;  // number of changes of the inputs
  // (6, 3 n_vK + n_vD, n_inputs) changes of q_K, v_K, acc_K and u_D, in powers of the time
  // since the start relative to the whole time
  const double* by_inputs;
  const double* p;
  const unsigned char* held;  // (n_rows,) rows that are held
  const double* q_D;  // (n_qD,) at the start
  const double* v_D;  // (n_vD,)
  const double* changes;  // (2 n_vD, m) changes of (q_D, v_D) at the start
  double* q_D_at;  // (n_times, n_qD)
  double* v_D_at;  // (n_times, n_vD)
  double* changes_at;  // (n_times, 2 n_vD, m)
  int status;  // Status
};

// A quadratic program of stages (search/stage_program.hpp).
struct StageProgramArrays {
  long long N;  // number of stages
  int n_z;  // number of states
  int k;  // number of inputs
  int m;  // number of rows
  const double* H;  // (N, k + n_z, k + n_z) Hessians by (u_i, z_{i+1})
  const double* g;  // (N, k + n_z) gradients
  const double* cross;  // (N, k + n_z, k) mixed derivatives by (u_{i-1}, z_i) and u_i
  const double* A;  // (N, n_z, n_z)
  const double* B;  // (N, n_z, k)
  const double* e;  // (N, n_z)
  const double* low;  // (N, k + n_z) bounds of (u_i, z_{i+1})
  const double* high;  // (N, k + n_z)
  const double* C;  // (N, m, 2 k + n_z) coefficients of rows in (u_{i-1}, z_i, u_i)
  const double* row_low;  // (N, m)
  const double* row_high;  // (N, m)
  const double* price;  // (N, m) prices of violating a row
  double unit;  // unit of the cost
  double unbounded;  // size that represents no bound
  double tolerance;  // tolerance of the residuals; of the barrier ten times this
  double barrier;  // smallest product of slacks and multipliers
  int most_iterations;
  double* u;  // (N, k)
  double* z;  // (N, n_z) z_1 and later
  double* costate;  // (N, n_z) multipliers of the dynamics
  double* passed;  // (N, m) violations of the rows
  double* force;  // (N, m) multipliers of the rows
  double* gain;  // (k, n_z) derivative of u_0 by z_0 with the last factors, or null
  int iterations;  // number of factorisations
  int solved;  // whether the tolerance was reached
  double primal;  // residual of the bounds
  double dual;  // residual of stationarity, relative to g
  double gap;  // mean product of slacks and multipliers
};

// A time step in every interval (search/stage_dynamics.hpp).
struct StageStepArrays {
  long long N;  // number of intervals
  int n_d;  // 2 n_vD
  int k;  // n_vK
  int columns;  // columns of motion; the first n_d + 3 k are used
  int is_first;  // whether it is the first step of the interval
  const double* motion;  // (N, n_d, columns) linearised (dq_D, v_D) after the step
  // (2 k, 3 k) derivative of (dq_K, v_K) before the step by q_K, v_K and acc_K at the start of
  // the interval
  Shared driven;
};

// A program of stages in real time (search/stage_clamped.hpp).
struct StageClampArrays {
  long long N;  // number of stages
  int n_d;  // 2 n_vD
  int n_inputs;  // n_vK; n_z = n_d + 2 n_vK
  int k;  // number of active inputs
  const int* inputs;  // (k,) active inputs
  int n_squares;  // rows of J
  int n_pulls;  // rows of C
  int n_joints;  // number of state variables with soft bounds
  Shared driven;  // (2 n_vK, 3 n_vK) derivative of (dq_K, v_K) after the interval
  const double* squares;  // (N, n_squares, n_z) J for z_{i+1}
  const double* diagonal;  // (N, n_vK + n_z) diagonal of the Hessian by (u_i, z_{i+1})
  const double* g;  // (N, n_vK + n_z) gradients
  double jerk;  // c: the cost contains -c u_{i-1} . u_i
  const double* pulls;  // (N, n_pulls, n_z + n_vK) C for (z_i, u_i)
  const double* pull_weight;  // (N, n_pulls) W
  double h;  // length of an interval [s]
  const double* acc;  // (N, n_vK) accelerations to be changed
  const double* q;  // (N + 1, n_vK) values of the driven coordinates
  const double* v;  // (N + 1, n_vK) velocities of the driven coordinates
  const double* most;  // (n_vK,) largest accelerations
  const double* last_most;  // (n_vK,) largest last accelerations
  const double* speed;  // (n_vK,) largest speeds
  const double* low;  // (n_vK,) bounds of the values
  const double* high;  // (n_vK,)
  const int* joint_places;  // (n_joints,) indices in z
  const double* joint;  // (N, n_joints) values after the intervals
  const double* joint_low;  // (n_joints,)
  const double* joint_high;  // (n_joints,)
  double price;  // price of violating a bound
  double unit;  // unit of the cost
  int shift;  // stages by which the horizon moved since the last solve; -1: no warm start
  int most_stages;  // largest total number of factorised stages
  double* u;  // (N, n_vK) changes of the accelerations
  double decrease;  // decrease of the cost
  int iterations;  // number of factorisations begun
  int stages;  // total number of factorised stages
  int solved;  // whether the active bounds are optimal
};

// A rollout of fixed steps, and the gradient of its cost.
struct GradientArrays {
  long long n;  // number of steps
  Options options;
  const double* winches;
  const double* p;
  Shared u_D;  // user forces of each step, or null
  const double* q_K;  // (n + 1, n_qK) driven configuration at each node
  const double* v_K;  // (n + 1, n_vK)
  const double* rate;  // (n, n_vK) dq_K/dt over the steps
  const double* mean;  // (n, n_vK) dv_K/dt over the steps
  double* q_D;  // (n + 1, n_qD) the first is the start
  double* v_D;  // (n + 1, n_vD) the first is the start
  double* acc_D;  // (n, n_vD) mean accelerations over the steps
  double* tension;  // (n, n_rows)
  double* ahead;  // (n, 2) times by which acc_D and its change are extrapolated [s]
  double reference_force;  // size of forces, such as the weight [N]
  int* n_points;  // (n,) numbers of contact points with force
  int* n_sliding;  // (n,) numbers of sliding contact points
  int* edges;  // (n,) StepEdge; the backward sweep adds bits
  int* pairs;  // (n,) contact pair of the edge; -1 for none
  double slip;  // largest slip of a winch [m]
  long long shortened;  // first shortened step; n for none
  long long n_steps;  // number of steps before the rollout ended
  int status;  // Status
  const unsigned char* held;  // (n, n_rows) rows that the steps hold
  const double* l_q;  // (n + 1, n_vD) partial derivatives of the cost by tangents of q_D
  const double* l_v;  // (n + 1, n_vD) partial derivatives by v_D
  const double* l_tension;  // (n, n_rows) partial derivatives by the tensions, or null
  double* g_q;  // (n_vD,) gradient by tangents of q_D at the start
  double* g_v;  // (n_vD,) gradient by v_D at the start
  double* g_qK;  // (n, n_vK) gradient by tangents of q_K in the steps
  double* g_rate;  // (n, n_vK) gradient by the rates
  double* g_mean;  // (n, n_vK) gradient by the mean accelerations
  double* g_u;  // (n, n_vD) gradient by u_D
  double* g_p;  // (n_p,) gradient by the parameters
};

// Targets, and the hanging poses nearest to them.
struct ReachArrays {
  long long n;  // number of poses
  int n_targets;  // number of points and coordinates with a target
  const int* links;  // (n_targets,) links of points; -1 for coordinates
  const int* columns;  // (n_targets,) velocities of coordinates, v_K after v_D
  const double* at;  // (n_targets, 3) points in their links' frames [m]
  const unsigned char* moves;  // (n_targets, n_vD + n_vK) velocities that move the link
  const double* places;  // (n, n_targets, 3) targets; NaN is free; coordinates use the first
  const double* weights;  // (n_targets,) weights of squared distances
  int single_pass;  // whether poses that are not reached are searched once only
  const double* q_D;  // (n_qD,) start of the search for the first pose
  const double* q_K;  // (n_qK,)
  const double* p;  // (n_p,)
  const double* tension;  // (n_rows,)
  const unsigned char* held;  // (n_rows,) active rows
  const unsigned char* may_change;  // (n_rows,) rows that may be added or removed
  const int* lengths;  // (n_rows,) index in v_K of a driven string's length; otherwise -1
  const unsigned char* moved;  // (n_vK + n_p,) unknowns of the search
  const double* low;  // (n_vK + n_p,) bounds of scalars
  const double* high;  // (n_vK + n_p,)
  const double* tension_low;  // (n_rows,) bounds of active rows' tensions
  const double* tension_high;  // (n_rows,)
  const double* joint_low;  // (n_vD,) bounds of scalars
  const double* joint_high;  // (n_vD,)
  double weight;  // weight of the puppet, as the size of forces [N]
  double tolerance;  // tolerance of the distance [m or rad]
  int max_iterations;
  int* status;  // (n,) ReachEnd
  int* iterations;  // (n,)
  double* out_q_D;  // (n, n_qD)
  double* out_q_K;  // (n, n_qK)
  double* out_p;  // (n, n_p)
  double* out_tension;  // (n, n_rows)
  unsigned char* out_held;  // (n, n_rows)
  double* left;  // (n, n_targets, 3) vectors from targets to actual positions; 0 if free
  double* price;  // (n, n_vK + n_p + n_rows + n_vD) multipliers of bounds, positive at high ones
  double* by;  // (n, n_vK + n_p, n_vD) derivative of q_D by the unknowns
  unsigned char* stable;  // (n,) whether V has a minimum at the pose
};

// A link's joint, and the indices of its coordinates.
struct JointPlace {
  int parent;  // parent link, or -1 for the world
  int role;  // 0: fixed; 1: in q_D; 2: in q_K
  int q;  // index of its first coordinate
  int slides;  // number of translations, which come first
  int turns;  // numbers of its rotation: 1 for an angle, 4 for a quaternion
};

// Pairs of solids whose clearance is measured.
struct ClearanceArrays {
  long long n_moving;
  long long n_standing;
  long long n_pairs;
  const Solid* moving;  // moving solids, measured against all standing ones
  const Solid* standing;
  const int* pairs;  // (n_pairs, 2) moving solids measured against one another
  const unsigned char* left_out;  // (n_moving, n_standing) pairs that are not measured
  // (n_strings,) radii, for strings against standing solids; negative: not measured
  const double* string_radius;
  const JointPlace* joints;  // (n_links,)
  const int* carriers;  // (n_points,) links of the strings' points; -1 for the world
  // distance of two solids without radii, one of them a mesh; null without meshes
  double (*exact)(const Solid*, const Solid*);
};

// A goal of a plan.
struct GoalArrays {
  int kind;  // GoalKind
  int link;  // link of a point
  const double* low;  // (n_qD,) bounds of a pose; an orientation is in low, weighted once
  const double* high;  // (n_qD,)
  const double* weight;  // (n_vD,)
  const double* v_D;  // (n_vD,) target
  const double* v_K;  // (n_vK,) target
  double at[3];  // point in its link's frame [m]
  double place[3];  // low corner of the target box of the point [m]
  double place_high[3];  // high corner [m]
  double speed_weight;  // weight of the error of v_D [s]
  double driven_weight;  // weight of the error of v_K [s]
  double tolerance;  // tolerance of the distance; negative: never stop at the goal
  int n_touches;  // number of required touches
  const int* touches;  // (n_pairs,) required touch of each contact pair, or -1
  double open;  // penalty in the distance for a required touch without force
};

// An equilibrium and the gains of the feedback to it.
struct LqrLawArrays {
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
  double* q_D;  // (n, segments, n_qD) state at its end
  double* v_D;  // (n, segments, n_vD)
  double* slip;  // (n, segments, n_strings)
  double* q_K;  // (n, segments, n_qK)
  double* v_K;  // (n, segments, n_vK)
  double* distance;  // (n, segments) distance to the goal at its end
  int* n_checks;  // (n, segments) number of checks; 0 without a segment
  int* catches;  // (n, segments) catches of strings and limits
};

// A planner's rollouts.
struct RolloutArrays {
  long long n;  // number of rollouts
  int segments;  // largest number of segments of a rollout
  int n_checks;  // number of checks of a segment
  int steps;  // number of steps between checks
  Options options;
  const double* p;
  const double* winches;
  const long long* start;  // (n,) index of the start of each rollout
  const double* q_D;  // starts
  const double* v_D;
  const double* slip;
  const double* q_K;
  const double* v_K;
  double* acc_K;  // (n, segments, n_vK); written where feedback determines them
  const int* n_segments;  // (n,) number of segments of each, at least 1
  const int* n_given;  // (n,) leading segments whose accelerations are given
  const int* law;  // (n,) index of its law
  const double* lead_time;  // (n,) time by which its reference runs ahead [s]
  const LqrLawArrays* laws;
  BoundArrays bounds;
  double margin;  // smallest allowed clearance [m]
  int may_slacken;  // whether strings that pull may go slack
  const ClearanceArrays* solids;
  const unsigned char* kept_off;  // (n_pairs,) contact pairs that must not touch; null for none
  GoalArrays goal;
  SegmentArrays out;
};

// State shared by the threads that simulate rollouts.
struct RolloutProgress {
  long long next;  // next rollout to simulate
  long long reached;  // first rollout at the goal so far, or n; -1 abandons all
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
  static constexpr int damping = work + 1;  // loss by damping and drag [J]
  static constexpr int impact = damping + 1;  // loss at catches [J]
  static constexpr int slip_loss = impact + 1;  // loss by slipping winches [J]
  static constexpr int friction = slip_loss + 1;  // loss by friction of contacts [J]
  static constexpr int slip = friction + 1;  // lengths let out by slipping winches [m]
  // error of the contact laws in the last step, relative to the largest speed in them [1]
  static constexpr int contact_residual = slip + Model::n_strings;
  static constexpr int width = contact_residual + 1;
};

// Offsets of the parts of an event.
struct EventLayout {
  enum : int { t, kind, row, impulse, speed, width };
};

// Offsets of the parts of a contact point.
struct ContactLayout {
  static constexpr int sample = 0;  // index of the sample in the record [1]
  static constexpr int pair = sample + 1;  // index of the pair of solids [1]
  static constexpr int gap = pair + 1;  // distance of their surfaces; negative if they overlap [m]
  static constexpr int point = gap + 1;  // midpoint between the surfaces, in the world [m]
  static constexpr int normal = point + 3;  // unit normal from the second solid to the first [1]
  static constexpr int force = normal + 3;  // force on the first solid, in the world [N]
  // velocity of the first solid relative to the second [m/s]
  static constexpr int velocity = force + 3;
  static constexpr int width = velocity + 3;
};

// Offsets of the numbers of a winch.
struct WinchLayout {
  enum : int { max_tension, rewind_speed, restitution, width };
};

// Parts of a sample that a batch can save, in the order of the sample.
struct Part {
  enum : int {
    q_D, v_D, acc_D, q_K, v_K, acc_K, force, taut, energy_terms, slip,
    contact_residual, n
  };
};

// Number of entries of a part.
template <class Model>
constexpr int part_width(int part) {
  const int widths[] = {
      Model::n_qD, Model::n_vD, Model::n_vD, Model::n_qK, Model::n_vK, Model::n_vK,
      Model::n_rows, Model::n_rows, 7, Model::n_strings, 1};
  return widths[part];
}

// The generated functions. A single result is written to the last argument; several are written to
// the members of `to` with their names (arrays, pointers or numbers). If `constants` is false,
// constant entries are not written: they keep the values of an earlier call with `constants`.
template <class Model, class Real>
struct Call {
  // Accelerations and tensions of any active set (Eqs. 10, 11): acc_D = solve_factor(L, w0 + W
  // lam), hddot = gamma + a0 + G lam, lam = -tension.
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

  // `dynamics` over a step dt: F contains damping and drag, velocity products use v_ahead.
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
  FAN_FN static void solve_factor_transposed(
      const Real* L, const Real* x, Real* y) {
    const Real* arg[] = {L, x};
    Real* res[] = {at(y)};
    Model::solve_factor_transposed(arg, res);
  }

  // y = F^-1 x.
  FAN_FN static void solve_factor(
      const Real* L, const Real* x, Real* y) {
    const Real* arg[] = {L, x};
    Real* res[] = {at(y)};
    Model::solve_factor(arg, res);
  }

  // Lag of the watched drives behind their commands.
  template <class Results>
  FAN_FN static void motor_lags(
      const Real* q_D, const Real* q_K, const Real* p, Results& to) {
    const Real* arg[] = {q_D, q_K, p};
    Real* res[] = {at(to.at), at(to.command), at(to.lag)};
    Model::motor_lags(arg, res);
  }

  // Share of its controller's demanded force that each watched motor can exert.
  FAN_FN static void motor_shares(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* acc_K, const Real* p, Real* share) {
    const Real* arg[] = {q_D, v_D, q_K, v_K, acc_K, p};
    Real* res[] = {at(share)};
    Model::motor_shares(arg, res);
  }

  // Force that controllers demand, without the bounds of the motors.
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

  // Residual force r of Eq. 10 at rest, h, and their derivatives.
  template <class Results>
  FAN_FN static void hanging(
      const Real* q_D, const Real* q_K, const Real* tension, const Real* p,
      Results& to) {
    const Real* arg[] = {q_D, q_K, tension, p};
    Real* res[] = {at(to.r), at(to.h), at(to.r_q), at(to.r_qK), at(to.r_p), at(to.A_D),
        at(to.A_K), at(to.h_p)};
    Model::hanging(arg, res);
  }

  // Gradient of z . r + y . hdot + y_h . h; r has velocity products of v_ahead, hdot is at
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

  // The nonzero entries of y = F^-T x for an x that is zero outside one joint.
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
