// Controller of the skill $source, for control loops in C++17; needs the standard library only.
// Written by structlearn $version: `structlearn export SKILL --cpp FOLDER` replaces it, do not edit.
//
//   $namespace::Controller controller(1000.0);           // Hz; plans all runs
//   controller.start(position, orientation);             // m; quaternion w, x, y, z
//   while (!controller.finished()) {
//     const unsigned flags = controller.tick(sample);    // the sensors' newest sample, or nullptr
//     follow(controller.position(), controller.orientation());
//   }
//
// It computes what structlearn.feedback.Controller does in Python, with the same flags. Everything
// that depends on time only is a table, which the constructor makes: that is where memory is
// allocated. A tick does not allocate, lock or throw. The constructor, start() and move_goal() throw
// std::invalid_argument on bad input, and leave the run as it was. A controller belongs to one
// thread; copies continue on their own. Numbers of equations are those of the dissertation.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#if defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "-ffast-math (-ffinite-math-only) takes away the check of sensor samples"
#endif

namespace $namespace {

// ---- Numbers of the skill file ------------------------------------------------------------------

inline constexpr std::size_t kPrimitives = $primitive_count;
inline constexpr std::size_t kChannels = $channels;  // of a sensor sample: $sensors
inline constexpr std::size_t kAxes = $axis_count;    // corrected by feedback: $axis_names

inline constexpr std::size_t kMostKernels = $most_kernels;  // sizes of the largest parts
inline constexpr std::size_t kMostLayers = $most_layers;
inline constexpr std::size_t kWidest = $widest;
inline constexpr std::size_t kMostValues = $most_values;
inline constexpr std::size_t kMostFeatures = $most_features;

template <std::size_t N>
using Numbers = std::array<double, N>;
using Vector = Numbers<3>;          // m, or rad
using Quaternion = Numbers<4>;      // w, x, y, z; own to base frame
using Sample = Numbers<kChannels>;  // of all sensors, in their order, as the drivers give them
using Matrix = std::array<Vector, 3>;

struct Pose {
  Vector position;
  Quaternion orientation;
};

/// Weights theta_i of the phase kernels; without kernels, the sum is 0.
template <std::size_t N>
struct Weights {
  std::size_t kernels;
  std::array<Numbers<N>, kMostKernels> theta;
};

enum class Frame { up, side, world };  // definition of the local frame (IV.6.1)

struct Primitive {
  const char* name;
  double duration;      // s, mean of the demonstrations like start and goal
  bool turns;           // whether it has an orientation
  Pose start;
  Pose goal;
  Frame frame;
  Vector amplitude;     // reach of the demonstrations on scaled local axes, 0 on the others
  Weights<3> position;  // in the local frame
  Weights<3> orientation;
};

/// Expected sensor traces of a primitive; without kernels, there are none.
struct Traces {
  Sample start, goal, velocity, acceleration;  // derivatives per duration and per its square
  Weights<kChannels> weights;
};

/// Phase-modulated network of a primitive and an axis; without kernels, there is none.
struct Network {
  std::size_t layers;                               // hidden ones
  std::array<std::size_t, kMostLayers + 1> widths;  // inputs, then each hidden layer
  Numbers<kMostValues> values;     // mean and scale of the inputs; of each layer W^T, then b
  Weights<kMostFeatures> readout;  // w_c,i (b_m,i, W_m,i): output of the modulated layer
};

inline constexpr std::array<Primitive, kPrimitives> kSkill = $skill;

inline constexpr std::array<Traces, kPrimitives> kExpected = $expected;

inline constexpr std::array<std::array<Network, kAxes>, kPrimitives> kNetworks = $networks;

/// Indices of the corrected axes among x, y, z, and rotations about them.
inline constexpr std::array<std::size_t, kAxes> kAxisIndices = $axis_indices;
inline constexpr Numbers<kAxes> kLargestCoupling = $largest_coupling;  // m or rad
inline constexpr double kFadeS = $fade_s;
inline constexpr double kStaleAfterS = $stale_after_s;
inline constexpr double kOffsetWithinS = $offset_within_s;

inline constexpr Vector kWorkspaceLow = $workspace_low;  // m; of starts and goals
inline constexpr Vector kWorkspaceHigh = $workspace_high;

// ---- Constants of the method --------------------------------------------------------------------

inline constexpr double kAlpha = 25.0;
inline constexpr double kBeta = kAlpha / 4.0;    // critically damped
inline constexpr double kAlphaG = kAlpha / 2.0;  // of the evolving goal
inline constexpr double kAlphaU = 25.0;          // of the canonical system
inline constexpr double kTauPerDuration = 2.0;
inline constexpr double kOverlap = 0.55;  // width of a kernel, in distances to the next centre
inline constexpr double kSmallestExponent = -700.0;
inline constexpr std::size_t kOffsetSamples = 5;  // a run's offset is the mean of its first samples
inline constexpr double kHeldDurations = 4.0;     // for which the last terms go on after the end
inline constexpr double kMostTicks = 1e7;
inline constexpr double kMostHz = 1e4;
inline constexpr double kUnitTolerance = 1e-6;
inline constexpr double kFarthestTurnRad = 60.0 / 180.0 * 3.14159265358979323846;

/// Status flags of a tick; 0 if there is nothing to report.
enum Status : unsigned {
  REJECTED = 1,      // the sample has a value that is not finite, or the network overflowed on it
  WAITING = 2,       // no feedback yet: the offset of the run is not known
  NO_OFFSET = 4,     // no feedback in this run: the offset was not known in time
  STALE = 8,         // the newest good sample is too old; the coupling terms fade
  SATURATED = 16,    // a coupling term is at its bound
  RATE_LIMITED = 32, // a coupling term changes at its largest rate
  NOT_STARTED = 64,  // start() comes before the first tick; the outputs are NaN
};

// ---- Phase and kernels --------------------------------------------------------------------------
// A further kind of primitive has its own phase() and KernelSum; all below takes the forcing terms
// as a table.

struct Phase {
  double p, u;
};

/// Phase and phase velocity after some time constants, closed-form (eq. IV.4, IV.5).
inline Phase phase(double time_constants) {
  constexpr double rate = 0.5 * kAlphaU;
  const double elapsed = rate * time_constants;
  const double decay = std::exp(-elapsed);
  return {(1.0 + elapsed) * decay, -rate * elapsed * decay};
}

/// f(p, u) = u sum_i psi_i(p) theta_i / sum_j psi_j(p), psi_i(p) = exp(-h_i (p - c_i)^2 / 2)
/// (eq. IV.6, IV.7): forcing terms, and with other weights the modulation of a network (eq. IV.29).
template <std::size_t N>
class KernelSum {
 public:
  explicit KernelSum(const Weights<N>& weights) : weights_(weights) {
    const std::size_t count = weights.kernels;
    for (std::size_t i = 0; i < count; ++i) {
      const double time = static_cast<double>(i) / static_cast<double>(count - 1);
      centres_[i] = phase(time / kTauPerDuration).p;
    }
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t gap = std::min(i, count - 2);  // the last width equals the one before
      const double width = kOverlap * (centres_[gap + 1] - centres_[gap]);
      half_widths_[i] = -0.5 / (width * width);
    }
  }

  Numbers<N> operator()(const Phase& at) const {
    Numbers<N> sum{};
    const std::size_t count = weights_.kernels;
    Numbers<kMostKernels> psi{};
    double largest = -std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < count; ++i) {
      const double distance = centres_[i] - at.p;
      psi[i] = distance * distance * half_widths_[i];
      largest = std::max(largest, psi[i]);
    }
    double total = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      psi[i] = std::exp(std::max(psi[i] - largest, kSmallestExponent));
      total += psi[i];
    }
    for (std::size_t i = 0; i < count; ++i) {
      const double feature = psi[i] * (at.u / total);
      std::transform(sum.begin(), sum.end(), weights_.theta[i].begin(), sum.begin(),
                     [feature](double f, double theta) { return f + feature * theta; });
    }
    return sum;
  }

 private:
  const Weights<N>& weights_;
  Numbers<kMostKernels> centres_{}, half_widths_{};
};

// ---- Transformation system ----------------------------------------------------------------------

/// One coordinate of a movement and its derivatives.
struct Motion {
  double x, xd, xdd;
};

/// State of one coordinate relative to the steady goal G: x - G, tau xd, g - G.
struct State {
  double x, v, g;
};

/// Exact transition of a state over one step for inputs f and its change (first-order hold):
/// tau^2 xdd = ALPHA (BETA (g - x) - tau xd) + f + c, tau gd = ALPHA_G (G - g) (eq. IV.1, IV.10).
struct Transition {
  std::array<Numbers<5>, 3> rows;

  /// `step`: dt / tau. All three poles are at -a, so the exponential is closed-form; where it would
  /// cancel, it is summed as a series of positive terms.
  explicit Transition(double step) {
    constexpr double a = 0.5 * kAlpha;
    static_assert(kAlphaG == a && kAlpha * kBeta == a * a, "a triple pole");
    const double y = a * step, decay = std::exp(-y);
    double held = 0.0;  // 1 - (1 + y) e^-y
    double ramp = 0.0;  // y - 2 + (2 + y) e^-y
    double term = y * decay;
    for (int n = 2; n < 100; ++n) {  // y <= a, since a primitive lasts half a tick at least
      term *= y / n;
      held += term;
      ramp += (n - 2) * term;
    }
    rows[0] = {(1.0 + y) * decay, step * decay, 0.5 * y * y * decay, held / (a * a),
               ramp / (a * a * y)};
    rows[1] = {-a * y * decay, (1.0 - y) * decay, a * (y - 0.5 * y * y) * decay, step * decay,
               held / (a * y)};
    rows[2] = {0.0, 0.0, decay, 0.0, 0.0};
  }

  State operator()(const State& s, double f, double change) const noexcept {
    const auto next = [&](const Numbers<5>& row) {
      return row[0] * s.x + row[1] * s.v + row[2] * s.g + row[3] * f + row[4] * change;
    };
    return {next(rows[0]), next(rows[1]), next(rows[2])};
  }
};

/// Evolving goal at which the system starts with the given acceleration (eq. IV.12).
inline double initial_goal(const Motion& at, double tau, double f) noexcept {
  return at.x + ((tau * tau * at.xdd - f) / kAlpha + tau * at.xd) / kBeta;
}

inline State started(const Motion& at, double goal, double tau, double f) noexcept {
  return {at.x - goal, tau * at.xd, initial_goal(at, tau, f) - goal};
}

inline Motion motion(const State& s, double goal, double tau, double f) noexcept {
  const double tau2_xdd = kAlpha * (kBeta * (s.g - s.x) - s.v) + f;
  return {s.x + goal, s.v / tau, tau2_xdd / (tau * tau)};
}

// ---- Rotations ----------------------------------------------------------------------------------

/// Hamilton product (eq. B.1): rotation b followed by a, both in the base frame.
inline Quaternion product(const Quaternion& a, const Quaternion& b) noexcept {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

inline Quaternion normalised(const Quaternion& q) noexcept {
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  return {q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm};
}

inline double norm(const Vector& v) noexcept {
  return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/// Rotation vector 2 log(target o q*) of the shorter rotation (eq. IV.2, B.3).
inline Vector difference(const Quaternion& target, const Quaternion& q) noexcept {
  const auto [r, x, y, z] = product(target, {q[0], -q[1], -q[2], -q[3]});
  const double sine = norm({x, y, z});
  double factor = sine < 1e-12 ? 2.0 : 2.0 * std::atan2(sine, std::abs(r)) / sine;
  if (r < 0.0) factor = -factor;
  return {factor * x, factor * y, factor * z};
}

/// q rotated by a rotation vector (eq. B.4), normalised.
inline Quaternion turned(const Quaternion& q, const Vector& by) noexcept {
  const double angle = norm(by);
  const double factor = angle < 1e-12 ? 0.5 : std::sin(0.5 * angle) / angle;
  return normalised(
      product({std::cos(0.5 * angle), factor * by[0], factor * by[1], factor * by[2]}, q));
}

// ---- Feedback -----------------------------------------------------------------------------------

/// exp(y) = 2^n exp(r), |r| <= ln(2) / 2, for |y| <= 700: without branches and calls, so that compilers
/// vectorise loops over it.
inline double vectorised_exp(double y) noexcept {
  static_assert(std::numeric_limits<double>::is_iec559, "2^n is made of bits");
  constexpr double kRound = 6755399441055744.0;  // 1.5 * 2^52: in a sum with it, n is in the last bits
  constexpr double kLog2E = 1.4426950408889634;
  constexpr double kLn2High = 0.6931471803691238, kLn2Low = 1.9082149292705877e-10;
  const double shifted = y * kLog2E + kRound, n = shifted - kRound;
  const double r = y - n * kLn2High - n * kLn2Low;
  double series = 1.0 / 6227020800.0;  // 1 + r + r^2 / 2! + ... + r^13 / 13!
  series = series * r + 1.0 / 479001600.0;
  series = series * r + 1.0 / 39916800.0;
  series = series * r + 1.0 / 3628800.0;
  series = series * r + 1.0 / 362880.0;
  series = series * r + 1.0 / 40320.0;
  series = series * r + 1.0 / 5040.0;
  series = series * r + 1.0 / 720.0;
  series = series * r + 1.0 / 120.0;
  series = series * r + 1.0 / 24.0;
  series = series * r + 1.0 / 6.0;
  series = series * r + 1.0 / 2.0;
  series = series * r + 1.0;
  series = series * r + 1.0;
  std::uint64_t bits;
  std::memcpy(&bits, &shifted, sizeof bits);
  bits = (bits + 1023) << 52;  // exponent of 2^n
  double power;
  std::memcpy(&power, &bits, sizeof power);
  return series * power;
}

/// Coupling term of a phase-modulated network, c = s + r . h_L (eq. IV.27-IV.30); `features`: s and r
/// of the due time, the two linear last layers folded with the phase.
inline double coupling_term(const Network& network, const Numbers<kMostFeatures>& features,
                            const Sample& deviation) noexcept {
  Numbers<kWidest> h{}, a{};
  const double* value = network.values.data();
  const std::size_t inputs = network.widths[0];
  for (std::size_t i = 0; i < inputs; ++i) {
    h[i] = (deviation[i] - value[i]) / value[inputs + i];
  }
  value += 2 * inputs;
  for (std::size_t layer = 0; layer < network.layers; ++layer) {  // h = tanh(a), a = W h + b
    const std::size_t before = network.widths[layer], width = network.widths[layer + 1];
    std::copy_n(value + before * width, width, a.begin());
    std::size_t i = 0;
    for (; i + 4 <= before; i += 4, value += 4 * width) {  // four inputs: a quarter of the memory accesses
      for (std::size_t j = 0; j < width; ++j) {
        a[j] = a[j] + value[j] * h[i] + value[width + j] * h[i + 1] + value[2 * width + j] * h[i + 2] +
               value[3 * width + j] * h[i + 3];
      }
    }
    for (; i < before; ++i, value += width) {
      for (std::size_t j = 0; j < width; ++j) a[j] += value[j] * h[i];
    }
    value += width;
    // beyond 20, tanh is 1 to the last digit; NaN stays. In one loop with the rest, this would branch
    for (std::size_t j = 0; j < width; ++j) a[j] = std::min(std::max(a[j], -20.0), 20.0);
    for (std::size_t j = 0; j < width; ++j) h[j] = 1.0 - 2.0 / (vectorised_exp(2.0 * a[j]) + 1.0);
  }
  const std::size_t width = network.widths[network.layers];
  Numbers<4> sums{features[0]};  // several, which do not wait for each other
  std::size_t j = 0;
  for (; j + 4 <= width; j += 4) {
    for (std::size_t k = 0; k < 4; ++k) sums[k] += features[1 + j + k] * h[j + k];
  }
  for (; j < width; ++j) sums[0] += features[1 + j] * h[j];
  return sums[0] + sums[1] + sums[2] + sums[3];
}

// ---- Checks -------------------------------------------------------------------------------------

[[noreturn]] inline void refuse(const char* what, const char* name, const char* why) {
  throw std::invalid_argument(std::string(what) + (*name ? " '" : "") + name + (*name ? "' " : " ") +
                              why);
}

template <std::size_t N>
bool finite(const Numbers<N>& values) noexcept {
  return std::all_of(values.begin(), values.end(), [](double one) { return std::isfinite(one); });
}

inline void require_point(const Vector& point, const char* what, const char* name) {
  if (!finite(point)) refuse(what, name, "must be finite");
  for (std::size_t d = 0; d < 3; ++d) {
    if (point[d] < kWorkspaceLow[d] || point[d] > kWorkspaceHigh[d]) {
      refuse(what, name, "is outside the workspace of the skill");
    }
  }
}

/// A normalised quaternion, not far from the demonstrated one if there is one.
inline Quaternion checked_unit(const Quaternion& q, const Quaternion* demonstrated,
                               const char* what, const char* name) {
  if (!finite(q)) refuse(what, name, "must be finite");
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (std::abs(length - 1.0) > kUnitTolerance) refuse(what, name, "must be a unit quaternion");
  if (demonstrated != nullptr && norm(difference(q, *demonstrated)) > kFarthestTurnRad) {
    refuse(what, name, "is more than 60 degrees from the demonstrations': is it w, x, y, z?");
  }
  return normalised(q);
}

inline Quaternion checked_goal_orientation(const Quaternion& q, const Primitive& primitive) {
  const Quaternion* demonstrated = primitive.turns ? &primitive.goal.orientation : nullptr;
  return checked_unit(q, demonstrated, "the goal orientation of", primitive.name);
}

/// Local axes in the base frame as columns: x along the reach (IV.6.1).
inline Matrix local_frame(const Vector& start, const Vector& goal, const Primitive& primitive) {
  if (primitive.frame == Frame::world) return {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  Vector x{goal[0] - start[0], goal[1] - start[1], goal[2] - start[2]};
  const double length = norm(x);
  if (length == 0.0) refuse("a local frame of", primitive.name, "needs a goal beside its start");
  for (double& one : x) one /= length;
  const std::size_t anchor = primitive.frame == Frame::up ? 2 : 1;
  Vector upright{};
  for (std::size_t d = 0; d < 3; ++d) upright[d] = (d == anchor ? 1.0 : 0.0) - x[anchor] * x[d];
  const double rest = norm(upright);
  if (rest < 1e-9) refuse("the reach of", primitive.name, "is parallel to its frame's anchor");
  for (double& one : upright) one /= rest;
  const auto cross = [](const Vector& a, const Vector& b) -> Vector {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  };
  const Vector y = anchor == 2 ? cross(upright, x) : upright;
  const Vector z = anchor == 2 ? upright : cross(x, upright);
  return {{{x[0], y[0], z[0]}, {x[1], y[1], z[1]}, {x[2], y[2], z[2]}}};
}

// ---- Controller ---------------------------------------------------------------------------------

using Durations = Numbers<kPrimitives>;
using Goals = std::array<Pose, kPrimitives>;

/// Means of the demonstrations, s.
inline Durations demonstrated_durations() noexcept {
  Durations durations{};
  for (std::size_t i = 0; i < kPrimitives; ++i) durations[i] = kSkill[i].duration;
  return durations;
}

/// Means of the demonstrations.
inline Goals demonstrated_goals() noexcept {
  Goals goals{};
  for (std::size_t i = 0; i < kPrimitives; ++i) goals[i] = kSkill[i].goal;
  return goals;
}

class Controller {
 public:
  /// Plan all runs; `feedback`: false keeps the coupling terms at 0.
  explicit Controller(double rate_hz, const Durations& durations = demonstrated_durations(),
                      const Goals& goals = demonstrated_goals(), bool feedback = true)
      : rate_hz_(rate_hz), dt_(1.0 / rate_hz), feedback_(feedback), default_goals_(goals) {
    if (!(rate_hz > 0.0 && rate_hz <= kMostHz)) {
      refuse("the rate of the controller", "", "must be positive, and at most 10000 Hz");
    }
    double total = 0.0;
    for (std::size_t i = 0; i < kPrimitives; ++i) {
      const Primitive& primitive = kSkill[i];
      if (!(durations[i] / dt_ > 0.5)) {
        refuse("the duration of", primitive.name, "must be a tick at least");
      }
      total += durations[i];
      Pose& goal = default_goals_[i];
      require_point(goal.position, "the goal of", primitive.name);
      goal.orientation = primitive.turns ? checked_goal_orientation(goal.orientation, primitive)
                                         : Quaternion{1.0, 0.0, 0.0, 0.0};
    }
    if (!(total <= kMostTicks * dt_)) refuse("the run", "", "would have more than 10000000 ticks");
    for (std::size_t place = 0; place < kAxes; ++place) {
      largest_change_[place] = kLargestCoupling[place] * dt_ / kFadeS;
    }
    offset_within_ = std::llrint(kOffsetWithinS * rate_hz);
    stale_after_ = std::llrint(kStaleAfterS * rate_hz);
    transitions_.reserve(kPrimitives);
    for (std::size_t i = 0; i < kPrimitives; ++i) {
      last_tick_ += samples(durations[i]) - 1;
      const bool last = i == kPrimitives - 1;
      plan(i, durations[i], samples(last ? (1.0 + kHeldDurations) * durations[i] : durations[i]));
    }
    orientation_.fill(kNaN);
    for (Vector* output : {&position_, &velocity_, &acceleration_, &angular_velocity_,
                           &angular_acceleration_}) {
      output->fill(kNaN);
    }
    deviation_.fill(kNaN);
  }

  /// Begin a run at rest, to the controller's goals; allocates nothing. `orientation`: unit quaternion
  /// w, x, y, z; of skills without orientations it is kept.
  void start(const Vector& position, const Quaternion& orientation) {
    const Primitive& first = kSkill[0];
    require_point(position, "the position at the start", "");
    const Quaternion* demonstrated = first.turns ? &first.start.orientation : nullptr;
    const Quaternion unit =
        checked_unit(orientation, demonstrated, "the orientation at the start", "");
    std::array<Motion, 3> at_rest{};
    for (std::size_t d = 0; d < 3; ++d) at_rest[d].x = position[d];
    to_base_ = scaled_frames(0, at_rest, default_goals_);  // the last that may throw
    goals_ = default_goals_;
    if (!first.turns) {
      for (Pose& goal : goals_) goal.orientation = unit;
    }
    position_ = position;
    orientation_ = unit;
    for (Vector* output : {&velocity_, &acceleration_, &angular_velocity_, &angular_acceleration_}) {
      output->fill(0.0);
    }
    deviation_.fill(kNaN);
    sensor_offset_.fill(0.0);
    last_valid_.fill(0.0);
    tick_ = sample_tick_ = 0;
    sample_count_ = 0;
    begin(0);
    started_ = true;
  }

  /// Advance to the next sample of the run; the first tick outputs the start itself.
  ///
  /// `sample`: the sensors' newest sample, if there is one since the last tick, else nullptr. One with
  /// a value that is not finite is rejected. Returns flags, see `Status`.
  unsigned tick(const Sample* sample = nullptr) noexcept {
    if (!started_) return NOT_STARTED;
    unsigned flags = receive(sample);
    flags |= step(flags);
    const std::size_t following = primitive_ + 1;
    if (following < kPrimitives && row_ == first_row_[following]) {  // the primitive has ended
      begin(following);
      flags |= step(flags);
    }
    ++tick_;
    return flags;
  }

  /// Move the goal of the running primitive or of a later one in this run, between ticks; position,
  /// velocity and acceleration stay continuous. `orientation`: nullptr leaves it as it is. Allocates
  /// nothing, and takes some tenths of a ms.
  void move_goal(std::size_t primitive, const Vector& position,
                 const Quaternion* orientation = nullptr) {
    if (!started_) refuse("move_goal()", "", "comes after start()");
    if (primitive >= kPrimitives) refuse("move_goal()", "", "of a primitive that there is not");
    const Primitive& moved = kSkill[primitive];
    if (primitive < primitive_) refuse("the goal of", moved.name, "cannot be moved: it has ended");
    require_point(position, "the goal of", moved.name);
    Goals goals = goals_;
    goals[primitive].position = position;
    if (orientation != nullptr) {
      goals[primitive].orientation = checked_goal_orientation(*orientation, moved);
    }
    std::array<Motion, 3> due{};
    const Vector forcing = position_forcing(row_, to_base_[primitive_]);
    for (std::size_t d = 0; d < 3; ++d) {
      due[d] = motion(point_[d], goals_[primitive_].position[d], tau_[primitive_], forcing[d]);
    }
    const auto end = end_motion(primitive_, row_, due, goals[primitive_], to_base_[primitive_]);
    to_base_ = scaled_frames(primitive_ + 1, end, goals);  // the last that may throw
    const Goals old = std::exchange(goals_, goals);
    if (primitive != primitive_) return;
    for (std::size_t d = 0; d < 3; ++d) {  // both are relative to the steady goal
      point_[d].x += old[primitive].position[d] - position[d];
      point_[d].g += old[primitive].position[d] - position[d];
    }
    const Quaternion evolving = turned(old[primitive].orientation, remaining_);
    remaining_ = difference(evolving, goals[primitive].orientation);
  }

  const Vector& position() const noexcept { return position_; }          // m
  const Vector& velocity() const noexcept { return velocity_; }          // m/s
  const Vector& acceleration() const noexcept { return acceleration_; }  // m/s^2
  const Quaternion& orientation() const noexcept { return orientation_; }
  const Vector& angular_velocity() const noexcept { return angular_velocity_; }  // rad/s, base frame
  const Vector& angular_acceleration() const noexcept { return angular_acceleration_; }
  /// Newest good sample - offset - expected; NaN where one of them is unknown.
  const Sample& deviation() const noexcept { return deviation_; }
  /// Coupling terms c on the skill's axes, m or rad.
  const Numbers<kAxes>& coupling() const noexcept { return coupling_; }
  /// Index of the running primitive; the sample of a switch belongs to the successor.
  std::size_t primitive() const noexcept { return primitive_; }
  /// Time of the outputs in s since the start.
  double time() const noexcept { return static_cast<double>(ticks_done()) / rate_hz_; }
  /// Phase p of the running primitive.
  double phase() const noexcept {
    // a switch has two rows, but is one sample
    const long long switches = static_cast<long long>(first_row_[primitive_] - primitive_);
    const double elapsed = dt_ * static_cast<double>(ticks_done() - switches);
    return $namespace::phase(elapsed / tau_[primitive_]).p;
  }
  /// Whether the last primitive has ended; ticks may continue, and the pose settles at the goal.
  bool finished() const noexcept { return ticks_done() >= last_tick_; }

 private:
  static constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

  /// What depends on time only, one per sample of each primitive, two at a switch.
  struct Row {
    Vector position_forcing;  // in the local frame, not scaled
    Vector orientation_forcing;
    Sample expected;
    std::array<Numbers<kMostFeatures>, kAxes> features;  // of the networks' outputs
  };

  long long samples(double duration) const { return std::llrint(duration / dt_) + 1; }

  /// Append the rows of a primitive.
  void plan(std::size_t index, double duration, long long count) {
    const double tau = kTauPerDuration * duration, step = dt_ / tau;
    const std::size_t begin = rows_.size(), end = begin + static_cast<std::size_t>(count);
    const KernelSum<3> position(kSkill[index].position), turning(kSkill[index].orientation);
    tau_[index] = tau;
    transitions_.emplace_back(step);
    first_row_[index] = begin;
    first_row_[index + 1] = end;
    rows_.resize(end);
    for (std::size_t row = begin; row < end; ++row) {
      Phase at = $namespace::phase(step * static_cast<double>(row - begin));
      if (index == kPrimitives - 1 && row == end - 1) at.u = 0.0;  // then it stays
      rows_[row].position_forcing = position(at);
      rows_[row].orientation_forcing = turning(at);
    }
    for (std::size_t place = 0; place < kAxes; ++place) {
      const KernelSum<kMostFeatures> readout(kNetworks[index][place].readout);
      for (std::size_t row = begin; row < end; ++row) {
        Phase at = $namespace::phase(step * static_cast<double>(row - begin));
        if (index == kPrimitives - 1 && row == end - 1) at.u = 0.0;
        rows_[row].features[place] = readout(at);
      }
    }
    plan_expected(kExpected[index], duration, begin);
  }

  /// Expected traces of the rows from `begin` on: unrolled like a movement.
  void plan_expected(const Traces& traces, double duration, std::size_t begin) {
    const double tau = kTauPerDuration * duration, step = dt_ / tau;
    const Transition& transition = transitions_.back();
    const KernelSum<kChannels> forcing(traces.weights);
    std::array<State, kChannels> states{};
    Sample now = forcing($namespace::phase(0.0));
    for (std::size_t i = 0; i < states.size(); ++i) {
      const Motion at{traces.start[i], traces.velocity[i] / duration,
                      traces.acceleration[i] / (duration * duration)};
      states[i] = started(at, traces.goal[i], tau, now[i]);
    }
    for (std::size_t row = begin; row < rows_.size(); ++row) {
      const Sample next = forcing($namespace::phase(step * static_cast<double>(row + 1 - begin)));
      for (std::size_t i = 0; i < states.size(); ++i) {
        rows_[row].expected[i] = traces.weights.kernels ? states[i].x + traces.goal[i] : kNaN;
        states[i] = transition(states[i], now[i], next[i] - now[i]);
      }
      now = next;
    }
  }

  /// Forcing term in the base frame; `to_base`: axes of the local frame, scaled (eq. IV.6).
  Vector position_forcing(std::size_t row, const Matrix& to_base) const noexcept {
    const Vector& local = rows_[row].position_forcing;
    Vector forcing{};
    for (std::size_t d = 0; d < 3; ++d) {
      forcing[d] = to_base[d][0] * local[0] + to_base[d][1] * local[1] + to_base[d][2] * local[2];
    }
    return forcing;
  }

  /// Scaled local frames of all primitives, new ones from `first` on, which starts `at`: those of the
  /// reach from where a primitive starts without feedback.
  std::array<Matrix, kPrimitives> scaled_frames(std::size_t first, std::array<Motion, 3> at,
                                                const Goals& goals) const {
    std::array<Matrix, kPrimitives> frames = to_base_;
    for (std::size_t i = first; i < kPrimitives; ++i) {
      const Vector start{at[0].x, at[1].x, at[2].x};
      const Vector& goal = goals[i].position;
      frames[i] = local_frame(start, goal, kSkill[i]);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double amplitude = kSkill[i].amplitude[axis];
        double distance = 0.0;
        for (std::size_t d = 0; d < 3; ++d) distance += (goal[d] - start[d]) * frames[i][d][axis];
        if (amplitude == 0.0) continue;
        for (std::size_t d = 0; d < 3; ++d) frames[i][d][axis] *= distance / amplitude;
      }
      at = end_motion(i, first_row_[i], at, goals[i], frames[i]);
    }
    return frames;
  }

  /// Motion at the end of a primitive that continues without feedback from a row.
  std::array<Motion, 3> end_motion(std::size_t primitive, std::size_t row, std::array<Motion, 3> at,
                                   const Pose& goal, const Matrix& to_base) const noexcept {
    const double tau = tau_[primitive];
    Vector now = position_forcing(row, to_base);
    std::array<State, 3> states{};
    for (std::size_t d = 0; d < 3; ++d) states[d] = started(at[d], goal.position[d], tau, now[d]);
    for (; row + 1 < first_row_[primitive + 1]; ++row) {
      const Vector next = position_forcing(row + 1, to_base);
      for (std::size_t d = 0; d < 3; ++d) {
        states[d] = transitions_[primitive](states[d], now[d], next[d] - now[d]);
      }
      now = next;
    }
    for (std::size_t d = 0; d < 3; ++d) at[d] = motion(states[d], goal.position[d], tau, now[d]);
    return at;
  }

  /// Start a primitive in the current output state; its goal absorbs the rest (eq. IV.12-IV.14).
  void begin(std::size_t primitive) noexcept {
    primitive_ = primitive;
    row_ = first_row_[primitive];
    coupling_.fill(0.0);  // the phase velocity is 0
    turned_ = orientation_;
    const double tau = tau_[primitive];
    const Vector forcing = position_forcing(row_, to_base_[primitive]);
    const Vector& turning = rows_[row_].orientation_forcing;
    for (std::size_t d = 0; d < 3; ++d) {
      point_[d] = started({position_[d], velocity_[d], acceleration_[d]},
                          goals_[primitive].position[d], tau, forcing[d]);
      rate_[d] = tau * angular_velocity_[d];
      remaining_[d] =
          initial_goal({0.0, angular_velocity_[d], angular_acceleration_[d]}, tau, turning[d]);
    }
    remaining_ = difference(turned(orientation_, remaining_), goals_[primitive].orientation);
  }

  /// Take over a valid sensor sample; flags for the sensor's problems.
  unsigned receive(const Sample* sample) noexcept {
    if (deviation_.empty()) return 0;
    unsigned flags = 0;
    const bool in_time = tick_ <= offset_within_;
    const bool for_offset = in_time && sample_count_ < kOffsetSamples;
    if (sample != nullptr && finite(*sample)) {
      sample_tick_ = tick_;
      last_valid_ = *sample;
      if (for_offset) {
        ++sample_count_;
        for (std::size_t i = 0; i < last_valid_.size(); ++i) {
          sensor_offset_[i] += last_valid_[i] / static_cast<double>(kOffsetSamples);
        }
      }
    } else if (sample != nullptr) {
      flags |= REJECTED;
    }
    if (sample_count_ < kOffsetSamples) flags |= in_time ? WAITING : NO_OFFSET;
    if (tick_ - sample_tick_ > stale_after_) flags |= STALE;
    return flags;
  }

  /// Outputs of the due row, and the step to the next row.
  unsigned step(unsigned sensor_flags) noexcept {
    const Row& row = rows_[row_];
    const std::size_t next_row = std::min(row_ + 1, first_row_[primitive_ + 1] - 1);
    for (std::size_t i = 0; i < deviation_.size(); ++i) {
      deviation_[i] = last_valid_[i] - sensor_offset_[i] - row.expected[i];
    }
    if (sensor_flags & (WAITING | NO_OFFSET)) deviation_.fill(kNaN);
    unsigned flags = 0;
    Numbers<6> coupling{};  // of positions, then of rotations
    for (std::size_t place = 0; place < coupling_.size(); ++place) {
      const Network& network = kNetworks[primitive_][place];
      const bool blind = network.widths[0] && (sensor_flags & (WAITING | NO_OFFSET | STALE));
      double wanted = 0.0;
      if (feedback_ && network.readout.kernels && !blind) {
        wanted = coupling_term(network, row.features[place], deviation_);
      }
      flags |= set_bounded(place, wanted);
      coupling[kAxisIndices[place]] = coupling_[place];
    }
    step_position(next_row, coupling);
    step_orientation(row.orientation_forcing, rows_[next_row].orientation_forcing, coupling);
    row_ = primitive_ == kPrimitives - 1 ? next_row : row_ + 1;
    return flags;
  }

  /// Set a coupling term, limited in magnitude and in change per tick.
  unsigned set_bounded(std::size_t place, double wanted) noexcept {
    const double largest = kLargestCoupling[place], largest_change = largest_change_[place];
    unsigned flags = 0;
    if (!std::isfinite(wanted)) {  // samples so large that the standardised inputs overflow
      wanted = 0.0;
      flags |= REJECTED;
    }
    if (std::abs(wanted) > largest) {
      wanted = std::copysign(largest, wanted);
      flags |= SATURATED;
    }
    const double change = wanted - coupling_[place];
    if (std::abs(change) > largest_change) {
      wanted = coupling_[place] + std::copysign(largest_change, change);
      flags |= RATE_LIMITED;
    }
    coupling_[place] = wanted;
    return flags;
  }

  /// Positions: the coupling term is held over the step.
  void step_position(std::size_t next_row, const Numbers<6>& coupling) noexcept {
    const Vector now = position_forcing(row_, to_base_[primitive_]);
    const Vector next = position_forcing(next_row, to_base_[primitive_]);
    const Vector& goal = goals_[primitive_].position;
    for (std::size_t d = 0; d < 3; ++d) {
      const double f = now[d] + coupling[d];
      const Motion at = motion(point_[d], goal[d], tau_[primitive_], f);
      position_[d] = at.x;
      velocity_[d] = at.xd;
      acceleration_[d] = at.xdd;
      point_[d] = transitions_[primitive_](point_[d], f, next[d] - now[d]);
    }
  }

  /// Rotations (eq. IV.2, IV.3, IV.9, IV.11): exact transition in the tangent space of the current
  /// orientation, where it is the origin and the error to the evolving goal a known input.
  void step_orientation(const Vector& now, const Vector& next, const Numbers<6>& coupling) noexcept {
    const double tau = tau_[primitive_];
    const Transition& transition = transitions_[primitive_];
    const Vector error = difference(turned(goals_[primitive_].orientation, remaining_), turned_);
    Vector turn{};
    for (std::size_t d = 0; d < 3; ++d) {
      const double f = now[d] + coupling[3 + d];
      const double steady = f + kAlpha * kBeta * (error[d] - remaining_[d]);
      angular_velocity_[d] = rate_[d] / tau;
      angular_acceleration_[d] =
          (f + kAlpha * kBeta * error[d] - kAlpha * rate_[d]) / (tau * tau);
      const State after = transition({0.0, rate_[d], remaining_[d]}, steady, next[d] - now[d]);
      turn[d] = after.x;
      rate_[d] = after.v;
      remaining_[d] = after.g;
    }
    orientation_ = turned_;
    turned_ = turned(turned_, turn);
  }

  long long ticks_done() const noexcept { return std::max(tick_ - 1, 0LL); }

  // plan
  double rate_hz_, dt_;
  bool feedback_;
  Goals default_goals_;
  std::vector<Row> rows_;
  std::array<std::size_t, kPrimitives + 1> first_row_{};
  std::vector<Transition> transitions_;
  Numbers<kPrimitives> tau_{};
  Numbers<kAxes> largest_change_{};
  long long offset_within_ = 0, stale_after_ = 0, last_tick_ = 0;  // ticks

  // state of a run
  bool started_ = false;
  Goals goals_{};
  std::array<Matrix, kPrimitives> to_base_{};
  std::size_t row_ = 0, primitive_ = 0;     // due ones
  long long tick_ = 0, sample_tick_ = 0;    // this tick, and that of the last valid sample
  std::size_t sample_count_ = 0;            // valid samples in the offset
  std::array<State, 3> point_{};            // at the due row
  Quaternion turned_{};                     // orientation at the due row
  Vector rate_{}, remaining_{};             // tau w; rotation vector from steady to evolving goal
  Sample last_valid_{}, sensor_offset_{};

  // outputs
  Vector position_{}, velocity_{}, acceleration_{}, angular_velocity_{}, angular_acceleration_{};
  Quaternion orientation_{};
  Sample deviation_{};
  Numbers<kAxes> coupling_{};
};

}  // namespace $namespace
