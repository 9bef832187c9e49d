#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <utility>

#include "core/math/inline.hpp"
#include "core/microscope/session/session.hpp"
#include "core/microscope/simulation/loop.hpp"
#include "core/microscope/simulation/observer.hpp"
#include "core/microscope/simulation/run_health.hpp"
#include "core/microscope/simulation/session_signals.hpp"
#include "core/microscope/simulation/test_record.hpp"
#include "core/signal/line_weights.hpp"

namespace proofmass {

/// Weighted sums over a record for one or two lines: [signal][2·line: cosine, 2·line + 1: sine].
template <typename T>
using SignalSums = std::array<std::array<T, 2 * num_fit_lines_max>, num_signals>;

/// The product that a session records.
///
/// @param common_x  Γ_mes,cx; the next two are Γ_mes,1x and Γ_mes,2x.
/// @param g         Rows of [T̂] − [În].
/// @param motion    Half the position of the moving masses, m.
template <typename T>
PROOFMASS_INLINE T product_signal(Product kind, const T& common_x, const T& sensor_1_x,
                                  const T& sensor_2_x, const std::array<Vector3<T>, 3>& g,
                                  const T& motion) {
  switch (kind) {
    case Product::none:
      break;
    case Product::common_squared:
      return common_x * common_x;
    case Product::sensor_1_squared:
      return sensor_1_x * sensor_1_x;
    case Product::sensor_2_squared:
      return sensor_2_x * sensor_2_x;
    case Product::modulated_yy:
      return (g[1].y - g[0].x) * motion;
    case Product::modulated_zz:
      return (g[2].z - g[0].x) * motion;
  }
  return T(0.0);
}

/// Angles of the estimated attitude, rad, without the part that is commanded: the ground knows it
/// and takes it out of the on-board estimate, which followed the star tracker with it.
template <typename T, typename Shared>
PROOFMASS_INLINE Vector3<T> ground_angle_RS_S(const Observation<T>& observation,
                                              const SharedSampleOf<Shared>& shared) {
  return observation.angle_RS_S - broadcast<T>(shared.commanded.angle_RS_S);
}

/// û in the estimated attitude.
/// @param angle_RS_S  ground_angle_RS_S().
template <typename T, typename Shared>
PROOFMASS_INLINE Vector3<T> ground_radial_S(const Vector3<T>& angle_RS_S,
                                            const SharedSampleOf<Shared>& shared) {
  return to_target(from_error_angles(angle_RS_S), broadcast<T>(shared.radial_R));
}

/// The signals of one sample, in the order of `Signal`. They are what the ground can compute: from
/// measurements, the estimated attitude, the orbit and the session's commands, not from the truth.
///
/// Γ_mes,c and Γ_mes,d are half sum and half difference of components in the two sensors' frames
/// ([Hardy2013] eq:common-diff). [T̂] − [În] is in the estimated frame S.
///
/// @param kind  The session's Product, or those of the lanes, for product_signal().
template <typename T, typename Shared, typename Kind>
PROOFMASS_INLINE std::array<T, num_signals> ground_signals(const Observation<T>& observation,
                                                           const SharedSampleOf<Shared>& shared,
                                                           const Kind& kind) {
  const Vector3<T>& m1 = observation.measured_K[0];
  const Vector3<T>& m2 = observation.measured_K[1];
  const T half = T(0.5);
  const T differential_x = half * (m1.x - m2.x);
  const Vector3<T> common = half * (m1 + m2);

  const Vector3<T> angle_RS_S = ground_angle_RS_S(observation, shared);
  const Vector3<T> omega_IS_S = observation.omega_RS_S - broadcast<T>(shared.commanded.omega_RS_S) +
                                broadcast<T>(shared.omega_IR_R);
  const Vector3<T> radial_S = ground_radial_S(angle_RS_S, shared);
  const auto [g] = gradient_matrix(shared.gradient_s2, radial_S, omega_IS_S,
                                   observation.measured_omega_dot_IS_S);

  const T motion = T(0.5) * T(shared.mass_motion.position_m);
  const T product = product_signal<T>(kind, common.x, m1.x, m2.x, g, motion);
  return {differential_x, common.x, common.y, common.z, g[0].x, g[0].y, g[0].z,
          product,        g[1].x,   g[1].y,   g[1].z,   g[2].x, g[2].y, g[2].z};
}

/// Weights of one or two lines that the method asks for.
struct LineReader {
  WeightReader weights;
  LineSignals signals;
};

/// What the runs of a batch share in one session.
struct SessionSetup {
  /// `at_rest` if no excitation moves one, `moving_twice` if the motion feels stiffness; several
  /// motions without it are `moving`, because only sessions with line readers have them.
  TestMasses masses = TestMasses::moving;
  WeightReader* reader = nullptr;
  DragFreeGains drag_free;
  AttitudeGains attitude;
  Product product = Product::none;
  SignalSet signals = SignalSet::all;
  /// Of the lines that the method asks for beside the session's own; none for most methods.
  std::span<LineReader> line_readers;
  /// Weights of the line at f_EP; null in a session that is not monitored.
  WeightReader* residual_reader = nullptr;
  const TestSetup* test = nullptr;  ///< Null in a session that does not test.
  ResonatorGains resonator;         ///< Of such a session's drag-free loop.
};

/// Weights of a block of samples.
struct BlockWeights {
  const double* lines = nullptr;     ///< Of the lines to be fitted; null while the loops settle.
  const double* residual = nullptr;  ///< Of the line at f_EP; null where it is not monitored.
  const double* further = nullptr;   ///< Of all line readers; null where these are none.
};

/// Adds one sample's signals to the sums of one output of the line weights.
template <std::size_t first, std::size_t last, typename T>
PROOFMASS_INLINE void add_weighted(const std::array<T, num_signals>& values, const T& weight,
                                   std::size_t output, SignalSums<T>& sums) {
  for (std::size_t s = first; s < last; ++s) {
    sums[s][output] = sums[s][output] + weight * values[s];
  }
}

/// Adds one sample's signals to the sums of every output.
/// @tparam Weight  A double, or T where lanes are in different sessions.
template <typename T, typename Weight>
PROOFMASS_INLINE void add_sample(const std::array<T, num_signals>& values, const Weight* weights,
                                 std::size_t num_outputs, Product product, SignalSet signals,
                                 SignalSums<T>& sums) {
  constexpr std::size_t product_index = index(Signal::product);
  for (std::size_t i = 0; i < num_outputs; ++i) {
    const T weight = T(weights[i]);
    if (signals == SignalSet::health) {
      add_weighted<0, 1>(values, weight, i, sums);
    } else {
      add_weighted<0, product_index>(values, weight, i, sums);
    }
    if (product != Product::none) {
      add_weighted<product_index, num_common_signals>(values, weight, i, sums);
    }
    if (signals == SignalSet::all) {
      add_weighted<num_common_signals, num_signals>(values, weight, i, sums);
    }
  }
}

/// Readers of further lines at most; each has one or two.
inline constexpr std::size_t num_line_readers_max = 10;

/// Weights of a block of one reader of further lines.
inline constexpr std::size_t line_block_size = LineWeights::block_size * 2 * num_fit_lines_max;

/// Weights of a block for the session's lines, for that at f_EP and for the further ones.
[[nodiscard]] constexpr std::size_t weights_buffer_size(std::size_t num_fit_lines,
                                                        std::size_t num_line_readers) {
  return LineWeights::block_size * 2 * (num_fit_lines + 1) + line_block_size * num_line_readers;
}

/// Sums of one reader of further lines: [signal of LineSignals][output].
template <typename T>
using LineSums = std::array<std::array<T, 2 * num_fit_lines_max>, num_line_signals>;

/// Sums of what is recorded for methods that ask for further lines.
template <typename T>
struct FurtherSums {
  std::array<LineSums<T>, num_line_readers_max> lines{};
  std::array<T, num_line_bases> plain{};  ///< Unweighted.
};

/// Adds one sample's signals of a line reader, in the order of LineSignals, to the sums of every
/// output. The further ones are made where they are added: a list of them would be written to
/// memory and read again.
/// @param further  The signals that not every line has, each over `factor`.
template <std::size_t num_further, typename T, typename Further>
PROOFMASS_INLINE void add_line(const std::array<T, num_signals>& values, const Further& further,
                               const T& factor, const double* weights, std::size_t num_outputs,
                               LineSums<T>& sums) {
  for (std::size_t i = 0; i < num_outputs; ++i) {
    const T weight = T(weights[i]);
    for (std::size_t s = 0; s < num_line_bases; ++s) {
      sums[s][i] = sums[s][i] + weight * values[s];
    }
    const T further_weight = weight * factor;
    for (std::size_t s = 0; s < num_further; ++s) {
      T& sum = sums[num_line_bases + s][i];
      sum = sum + further_weight * further(s);
    }
  }
}

/// Adds one sample to the sums of the further lines.
/// @param values   The ground's signals.
/// @param weights  Of the block's first sample; `k` samples later is the one to be added.
template <typename T, typename Shared>
PROOFMASS_INLINE void add_further(const std::array<T, num_signals>& values,
                                  const Observation<T>& observation,
                                  const SharedSampleOf<Shared>& shared, const SessionSetup& setup,
                                  const double* weights, std::size_t k, FurtherSums<T>& sums) {
  constexpr std::size_t first_row = index(Signal::gradient_xx), rest = index(Signal::gradient_yx);
  for (std::size_t s = 0; s < num_line_bases; ++s) sums.plain[s] = sums.plain[s] + values[s];
  for (std::size_t i = 0; i < setup.line_readers.size(); ++i) {
    const auto& [reader, signals] = setup.line_readers[i];
    const std::size_t num_outputs = 2 * reader.weights().num_fit_lines();
    const double* const at = weights + i * line_block_size + k * num_outputs;
    switch (signals) {
      case LineSignals::gradients: {
        const auto row = [&](std::size_t s) { return values[rest + s]; };
        add_line<6>(values, row, T(1.0), at, num_outputs, sums.lines[i]);
        break;
      }
      case LineSignals::squares: {
        const auto square = [&](std::size_t s) {
          return observation.measured_K[s].x * observation.measured_K[s].x;
        };
        add_line<2>(values, square, T(1.0), at, num_outputs, sums.lines[i]);
        break;
      }
      case LineSignals::moved:
      case LineSignals::moved_again: {
        const auto element = [&](std::size_t s) {
          return values[s < 3 ? first_row + s : rest + s - 3];
        };
        const auto& moved =
            signals == LineSignals::moved ? shared.mass_motion : shared.second_motion;
        const T motion = T(0.5) * T(moved.position_m);
        add_line<9>(values, element, motion, at, num_outputs, sums.lines[i]);
        break;
      }
    }
  }
}

/// The runs that one T holds, in one session.
/// @tparam Hardware  Of the loop.
template <typename T, typename Noise, typename Hardware = PaperHardware>
struct LaneGroup {
  LoopConstants<T> constants;
  Noise noise;  ///< next() yields the SampleNoise<T> of each sample, settling included.
  Loop<T> loop{};
  SignalSums<T> sums{};
  LoopMonitor<T> monitor{};
  FurtherSums<T> further{};
  T eotvos_parameter{};  ///< Acts in test sessions alone, as what follows.
  Resonator<T> resonator{};
  TestSums<T> test{};
  [[no_unique_address]] Hardware hardware{};
};

/// What a session leaves of a run.
struct SessionOutcome {
  SignalSums<double> sums{};
  SessionHealth health;
  FurtherSums<double> further{};
  TestProducts test_products{};  ///< Of a test session, as what follows.
  SquareSteps<double> square_steps{};
};

/// Whether LoopMonitor is filled.
enum class Monitoring : std::uint8_t { off, on };

/// Whether lines are recorded beside the session's own.
enum class RecordedLines : std::uint8_t { own, further };

/// What a compiled sample loop computes. Parts that are left out are not even branches in it.
struct SampleKind {
  TestMasses masses = TestMasses::moving;
  SignalSet signals = SignalSet::all;
  bool has_product = true;  ///< Of any kind but Product::none.
  Monitoring monitoring = Monitoring::off;
  RecordedLines lines = RecordedLines::own;
  bool is_test = false;  ///< Masses may fall apart, and the products of a test are summed.
};

/// The sample loops that are compiled, for processors and GPUs. Each session of the paper's
/// campaign has one that computes what it needs and no more, except for the one that is monitored;
/// the last one covers all others. A loop for each combination would take the compiler minutes.
inline constexpr std::array sample_kinds{
    SampleKind{.monitoring = Monitoring::on},
    SampleKind{TestMasses::moving, SignalSet::common},
    SampleKind{TestMasses::at_rest, SignalSet::common, false},
    SampleKind{TestMasses::at_rest, SignalSet::common},
    SampleKind{TestMasses::at_rest, SignalSet::all, false},
    SampleKind{},
};
inline constexpr std::size_t monitored_kind = 0;
inline constexpr std::size_t general_kind = sample_kinds.size() - 1;

/// Index of the kind that takes the least time for a session.
[[nodiscard]] constexpr std::size_t sample_kind_for(TestMasses masses, SignalSet signals,
                                                    Product product, Monitoring monitoring) {
  if (monitoring == Monitoring::on) return monitored_kind;
  const bool has_product = product != Product::none;
  constexpr auto kinds = sample_kinds;  // A kernel must refer to no variable of all programs.
  for (std::size_t i = monitored_kind + 1; i < general_kind; ++i) {
    const SampleKind& kind = kinds[i];
    if (kind.masses == masses && kind.signals == signals && (kind.has_product || !has_product)) {
      return i;
    }
  }
  return general_kind;
}

/// By how much the masses of a group fall apart in a session of a kind.
template <SampleKind kind, typename T>
PROOFMASS_INLINE auto violation_of(const T& eotvos_parameter, double gravity_m_s2) {
  if constexpr (kind.is_test) {
    return Violation<T>{eotvos_parameter, gravity_m_s2};
  } else {
    return NoViolation{};
  }
}

/// The drag-free controller gets what a resonator makes of it.
template <typename T>
struct Resonant {
  Resonator<T>& resonator;
  const ResonatorGains& gains;

  PROOFMASS_INLINE Vector3<T> operator()(const Vector3<T>& input_S) const {
    return resonator.advance(gains, input_S);
  }
};

/// What the drag-free controller gets in a session of a kind.
template <SampleKind kind, typename T>
PROOFMASS_INLINE auto shaping_of(Resonator<T>& resonator, const ResonatorGains& gains) {
  if constexpr (kind.is_test) {
    return Resonant<T>{resonator, gains};
  } else {
    return AsMeasured{};
  }
}

/// Advances all groups by some samples.
/// @tparam kind     Covers what `setup` asks for.
/// @param weights   Of these samples; none while the loops settle, when nothing is summed.
/// @param observer  NoObserver or, for a run alone, SessionObserver.
template <SampleKind kind, typename Signals, typename Group, typename Observer>
__attribute__((noinline)) void advance_groups(Signals& signals, const SessionSetup& setup,
                                              std::span<Group> groups, std::size_t num_samples,
                                              const BlockWeights& weights, Observer& observer) {
  const std::size_t num_outputs = 2 * setup.reader->weights().num_fit_lines();
  const Product product = kind.has_product ? setup.product : Product::none;
  const SignalSet recorded = kind.signals == SignalSet::all ? setup.signals : SignalSet::common;
  for (std::size_t k = 0; k < num_samples; ++k) {
    const SharedSample& shared = signals.next();
    const double gravity_m_s2 = kind.is_test ? setup.test->gravity_m_s2(shared) : 0.0;
    for (auto& [constants, noise, loop, sums, monitor, further, eotvos_parameter, resonator, test,
                hardware] : groups) {
      hardware.begin_sample(constants);
      if constexpr (Observer::is_active) observer.begin_sample(loop);
      const auto observation = loop.template advance<kind.masses>(
          constants, setup.drag_free, setup.attitude, shared, noise.next(),
          k % 4 == 0 ? Watch::yes : Watch::no, violation_of<kind>(eotvos_parameter, gravity_m_s2),
          shaping_of<kind>(resonator, setup.resonator), hardware);
      if constexpr (Observer::is_active) {
        observer(shared, observation, ground_signals(observation, shared, setup.product));
      }
      if (weights.lines == nullptr) continue;
      const auto values = ground_signals(observation, shared, product);
      if constexpr (!kind.is_test) {
        add_sample(values, weights.lines + k * num_outputs, num_outputs, product, recorded, sums);
      }
      if constexpr (kind.lines == RecordedLines::further) {
        add_further(values, observation, shared, setup, weights.further, k, further);
      }
      if constexpr (kind.is_test) {
        const auto radial_S = ground_radial_S(ground_angle_RS_S(observation, shared), shared);
        test.add(test_signals(values, gravity_m_s2, radial_S), k % test_block_size, *setup.test);
      }
      if constexpr (kind.lines == RecordedLines::further) {
        if (weights.residual == nullptr) continue;
      }
      if constexpr (kind.monitoring == Monitoring::on) {
        monitor.add(constants.sensors, observation, weights.residual + 2 * k);
      }
    }
  }
}

template <typename Signals, typename Group, typename Observer>
using AdvanceGroups = void (*)(Signals&, const SessionSetup&, std::span<Group>, std::size_t,
                               const BlockWeights&, Observer&);

static_assert(LineWeights::block_size % test_block_size == 0);

/// The compiled loop for a session. Where further lines are recorded, two loops serve all sessions,
/// one of them also those that feel stiffness, and one serves those that test.
template <typename Signals, typename Group, typename Observer>
AdvanceGroups<Signals, Group, Observer> advance_groups_of(const SessionSetup& setup) {
  using enum TestMasses;
  if (setup.test != nullptr) {
    constexpr SampleKind kind{at_rest,         SignalSet::all,     false,
                              Monitoring::off, RecordedLines::own, true};
    return advance_groups<kind, Signals, Group, Observer>;
  }
  if (!setup.line_readers.empty() || setup.masses == moving_twice) {
    constexpr SampleKind kind{moving_twice, SignalSet::all, true, Monitoring::on,
                              RecordedLines::further};
    constexpr SampleKind kind_at_rest{at_rest, SignalSet::all, true, kind.monitoring, kind.lines};
    return setup.masses == at_rest ? advance_groups<kind_at_rest, Signals, Group, Observer>
                                   : advance_groups<kind, Signals, Group, Observer>;
  }
  const Monitoring monitoring = setup.residual_reader != nullptr ? Monitoring::on : Monitoring::off;
  const std::size_t wanted =
      sample_kind_for(setup.masses, setup.signals, setup.product, monitoring);
  return [&]<std::size_t... i>(std::index_sequence<i...>) {
    constexpr auto compiled = [](std::size_t kind) {
      return Observer::is_active && kind != monitored_kind ? general_kind : kind;
    };
    constexpr std::array loops{
        &advance_groups<sample_kinds[compiled(i)], Signals, Group, Observer>...};
    return loops[wanted];
  }
  (std::make_index_sequence<sample_kinds.size()>());
}

/// Writes the weights of a block: first those of the lines to be fitted, then those at f_EP if the
/// session is monitored, then those of the further lines.
/// @param buffer  Room for weights_buffer_size() weights.
[[nodiscard]] inline BlockWeights fill_block(const SessionSetup& setup, std::size_t block,
                                             std::span<double> buffer) {
  setup.reader->fill_block(block, buffer);
  BlockWeights weights{.lines = buffer.data()};
  buffer = buffer.subspan(LineWeights::block_size * 2 * setup.reader->weights().num_fit_lines());
  if (setup.residual_reader != nullptr) {
    setup.residual_reader->fill_block(block, buffer);
    weights.residual = buffer.data();
  }
  buffer = buffer.subspan(2 * LineWeights::block_size);
  if (setup.line_readers.empty()) return weights;
  weights.further = buffer.data();
  for (LineReader& reader : setup.line_readers) {
    reader.weights.fill_block(block, buffer);
    buffer = buffer.subspan(line_block_size);
  }
  return weights;
}

/// Runs one session from settling to its last sample and sums its signals.
///
/// @param signals   Like SessionSignals, not yet asked for any sample.
/// @param groups    With zero sums and a loop that has not begun.
/// @param buffer    Room for weights_buffer_size() weights.
/// @param progress  Called with the number of record samples done after each block.
/// @param observer  Gets every sample, settling included.
template <typename Signals, typename Group, typename Progress, typename Observer>
inline void record_session(Signals& signals, const SessionSetup& setup, std::span<Group> groups,
                           std::span<double> buffer, const Progress& progress, Observer observer) {
  for (Group& group : groups) group.loop.begin(signals.reference_at_start());
  const auto num_settling = static_cast<std::size_t>(signals.num_settling());
  const auto advance = advance_groups_of<Signals, Group, Observer>(setup);
  advance(signals, setup, groups, num_settling, {}, observer);
  for (Group& group : groups) group.loop.begin_record();
  const LineWeights& weights = setup.reader->weights();
  std::size_t num_done = 0;
  for (std::size_t block = 0; block < weights.num_blocks(); ++block) {
    const BlockWeights block_weights = fill_block(setup, block, buffer);
    const std::size_t num_samples = weights.samples_in(block);
    advance(signals, setup, groups, num_samples, block_weights, observer);
    // A block that is not full has a sum of its own size.
    if (num_samples == LineWeights::block_size) {
      for (Group& group : groups) group.monitor.end_block(block == 0);
    }
    num_done += num_samples;
    progress(num_done);
  }
}

}  // namespace proofmass
