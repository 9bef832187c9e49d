#pragma once

#include "core/microscope/simulation/gpu/lanes.hpp"
#include "core/random/normal_deviates.hpp"

namespace proofmass::gpu {

// What a thread does. The same functions are compiled for a GPU and, by tests, for the host.

/// Takes up what memory may hold anew: otherwise the compiler reads all constants before the loop
/// and keeps them where there is no room for them.
PROOFMASS_INLINE void forget_memory() { asm volatile("" ::: "memory"); }

/// A filter whose number of poles the compiler knows.
template <std::size_t num_poles, bool pair>
struct FixedFilter {
  static constexpr std::size_t num_real = num_poles;
  static constexpr bool has_pair = pair;
  const double& gain;
  const std::array<double, NoiseFilter::num_poles_max>& pole;
  const std::array<double, NoiseFilter::num_poles_max>& coefficient;
  const ComplexDouble& pair_pole;
  const ComplexDouble& pair_coefficient;
};

/// Philox of one stream of one run, block after block.
struct WhiteStream {
  std::uint64_t seed, run;
  std::uint32_t stream;

  PROOFMASS_INLINE std::array<float, 4> deviates(std::uint32_t block) const {
    return normal_deviates(RandomStream(seed, RunIndex{run}, stream).block(block));
  }
};

/// Makes the noise of a coloured channel.
template <std::size_t num_poles, bool pair>
PROOFMASS_INLINE void make_coloured(const NoiseFilter& by, const WhiteStream& stream,
                                    const Portion& portion, std::uint64_t* state_words,
                                    std::size_t lane, double* out) {
  const FixedFilter<num_poles, pair> filter{by.gain, by.pole, by.coefficient, by.pair_pole,
                                            by.pair_coefficient};
  auto state = load_words<NoiseState<double>>(state_words, lane);
  for (std::uint32_t k = 0; k < portion.count; k += samples_per_noise_block) {
    forget_memory();
    const auto block = static_cast<std::uint32_t>((portion.first + k) / samples_per_noise_block);
    const std::array<float, 4> deviates = stream.deviates(block);
    const OfSamples<double> white{deviates[0], deviates[1], deviates[2], deviates[3]};
    const OfSamples<double> values = state.advance(filter, white);
    for (std::size_t i = 0; i < values.size(); ++i) {
      out[(k + i) * (noise_sample_bytes / sizeof(double))] = values[i];
    }
  }
  store_words(state, state_words, lane);
}

template <std::size_t num_poles>
PROOFMASS_INLINE void make_coloured_of(const NoiseFilter& filter, const WhiteStream& stream,
                                       const Portion& portion, std::uint64_t* state_words,
                                       std::size_t lane, double* out) {
  if (filter.num_real != num_poles) {
    if constexpr (num_poles > 0) {
      make_coloured_of<num_poles - 1>(filter, stream, portion, state_words, lane, out);
    }
    return;
  }
  if (filter.has_pair) {
    make_coloured<num_poles, true>(filter, stream, portion, state_words, lane, out);
  } else {
    make_coloured<num_poles, false>(filter, stream, portion, state_words, lane, out);
  }
}

/// Makes one channel's noise for one lane, for the samples of a portion and up to three beyond.
PROOFMASS_INLINE void make_noise(const Shared& shared, const SessionTable* sessions,
                                 const GroupMemory& memory, const Portion& portion,
                                 std::size_t position, std::size_t channel, std::size_t lane) {
  const WhiteStream stream{shared.seed, memory.runs[portion.slot * group_lanes + lane],
                           sessions[portion.session].streams[channel]};
  std::byte* const noise = memory.noise + position * memory.launch_samples * noise_sample_bytes;
  if (channel < num_coloured_channels) {
    const std::size_t shape = channel >= 6 ? 2 : (channel % 3 == 0 ? 0 : 1);
    constexpr std::size_t state_words = num_words<NoiseState<double>> * group_lanes;
    make_coloured_of<num_device_poles_max>(
        shared.filter[shape], stream, portion,
        memory.noise_states + (portion.slot * num_coloured_channels + channel) * state_words, lane,
        reinterpret_cast<double*>(noise) + channel * group_lanes + lane);
    return;
  }
  float* const out = reinterpret_cast<float*>(noise) +
                     (2 * num_coloured_channels + channel - num_coloured_channels) * group_lanes +
                     lane;
  for (std::uint32_t k = 0; k < portion.count; k += samples_per_noise_block) {
    const auto block = static_cast<std::uint32_t>((portion.first + k) / samples_per_noise_block);
    const std::array<float, 4> deviates = stream.deviates(block);
    for (std::size_t i = 0; i < deviates.size(); ++i) {
      out[(k + i) * (noise_sample_bytes / sizeof(float))] = deviates[i];
    }
  }
}

/// Reads what is read once, so that it takes no place of what is read again.
template <typename T>
PROOFMASS_INLINE T load_once(const T* address) {
#ifdef __CUDA_ARCH__
  T value;
  if constexpr (std::is_same_v<T, double>) {
    asm volatile("ld.global.cg.f64 %0, [%1];" : "=d"(value) : "l"(address));
  } else {
    asm volatile("ld.global.cg.f32 %0, [%1];" : "=f"(value) : "l"(address));
  }
  return value;
#else
  return *address;
#endif
}

/// The noise of one sample of one lane as it lies in memory.
struct RawNoise {
  double coloured[num_coloured_channels];
  float white[num_white_channels];

  PROOFMASS_INLINE void load(const std::byte* sample, std::size_t lane) {
    const auto* const doubles = reinterpret_cast<const double*>(sample) + lane;
    for (std::size_t c = 0; c < num_coloured_channels; ++c)
      coloured[c] = load_once(doubles + c * group_lanes);
    const auto* const floats =
        reinterpret_cast<const float*>(sample) + 2 * num_coloured_channels * group_lanes + lane;
    for (std::size_t c = 0; c < num_white_channels; ++c)
      white[c] = load_once(floats + c * group_lanes);
  }
  PROOFMASS_INLINE SampleNoise<double> shaped(const Shared& levels) const {
    SampleNoise<double> noise;
    for (std::size_t c = 0; c < num_coloured_channels; ++c) coloured_place(noise, c) = coloured[c];
    set_white(
        levels,
        [this](std::size_t c) { return static_cast<double>(white[c - num_coloured_channels]); },
        noise);
    return noise;
  }
};

/// Loads or keeps what a kind of loop sums.
template <SampleKind kind, std::size_t num_lines, typename Function>
PROOFMASS_INLINE void for_each_sum(const Function& function) {
  constexpr std::size_t num_recorded =
      kind.signals == SignalSet::all ? num_signals : num_common_signals;
  for (std::size_t s = 0; s < num_recorded; ++s) {
    if (!kind.has_product && s == index(Signal::product)) continue;
    for (std::size_t i = 0; i < 2 * num_lines; ++i) function(s, i);
  }
}

/// Samples that a block of threads keeps in its fast memory at once.
inline constexpr std::size_t staged_samples = 16;

/// What the threads of a block read together, in its fast memory.
struct Stage {
  SharedSample samples[staged_samples];
  double weights[staged_samples][2 * num_fit_lines_max];
  double residual[staged_samples][2];
};

/// The threads of a block, of which each calls the functions for its own lane.
struct Threads {
  std::size_t index = 0;
  std::size_t count = 1;

  /// Waits until all threads are here. What one wrote before, the others read afterwards.
  PROOFMASS_INLINE void meet() const {
#ifdef __CUDA_ARCH__
    __syncthreads();
#endif
  }
  PROOFMASS_INLINE void copy(const void* from, std::size_t num_bytes, void* to) const {
    const auto* const source = static_cast<const double*>(from);
    auto* const target = static_cast<double*>(to);
    for (std::size_t i = index; i < num_bytes / sizeof(double); i += count) target[i] = source[i];
  }
};

/// What a block of threads works on.
struct Block {
  const Shared& shared;
  const SessionTable& session;
  const GroupMemory& memory;
  const Portion& portion;
  std::size_t position;      ///< Of the portion in its launch.
  std::uint64_t* constants;  ///< Words of LoopConstants<double> in fast memory.
  Stage* stage;              ///< In fast memory, too.
  Threads threads;
};

/// Fills the stage with the samples from `first` on, at most `count`, and their weights.
template <SampleKind kind, std::size_t num_lines>
PROOFMASS_INLINE void stage_samples(const SessionTable& session, std::uint64_t first,
                                    std::size_t count, const Threads& threads, Stage& stage) {
  if (count > staged_samples) count = staged_samples;
  threads.meet();
  threads.copy(session.samples + first, count * sizeof(SharedSample), stage.samples);
  for (std::size_t i = threads.index; i < count; i += threads.count) {
    if (first + i < session.num_settling) continue;
    const std::uint64_t of_record = first + i - session.num_settling;
    for (std::size_t j = 0; j < 2 * num_lines; ++j) {
      stage.weights[i][j] = session.weights[of_record * 2 * num_lines + j];
    }
    if (kind.monitoring != Monitoring::on) continue;
    for (std::size_t j = 0; j < 2; ++j) {
      stage.residual[i][j] = session.residual[of_record * 2 + j];
    }
  }
  threads.meet();
}

/// Advances one lane by the samples of a portion.
template <SampleKind kind, std::size_t num_lines>
PROOFMASS_INLINE void advance_lane(const Block& block, std::size_t lane) {
  const auto& [shared, session, memory, portion, position, constants, stage, threads] = block;
  constexpr std::size_t slot_words = num_words<LaneState> * group_lanes;
  std::uint64_t* const loop_words = memory.states + portion.slot * slot_words;
  std::uint64_t* const sum_words = loop_words + num_words<Loop<double>> * group_lanes;
  std::uint64_t* const monitor_words = sum_words + num_words<SignalSums<double>> * group_lanes;
  auto* const sum_memory = reinterpret_cast<double*>(sum_words) + lane;
  const auto sum_index = [](std::size_t s, std::size_t i) {
    return (s * 2 * num_fit_lines_max + i) * group_lanes;
  };

  Loop<double> loop{};
  SignalSums<double> sums{};
  LoopMonitor<double> monitor{};
  if (portion.first == 0) {
    for (std::size_t i = 0; i < num_words<LaneState>; ++i) loop_words[i * group_lanes + lane] = 0;
    loop.begin(session.reference);
  } else {
    loop = load_words<Loop<double>>(loop_words, lane);
    for_each_sum<kind, num_lines>(
        [&](std::size_t s, std::size_t i) { sums[s][i] = sum_memory[sum_index(s, i)]; });
    if (kind.monitoring == Monitoring::on) {
      monitor = load_words<LoopMonitor<double>>(monitor_words, lane);
    }
  }

  const std::byte* noise = memory.noise + position * memory.launch_samples * noise_sample_bytes;
  const Product product = kind.has_product ? session.product : Product::none;
  const SignalSet recorded = kind.signals == SignalSet::all ? session.signals : SignalSet::common;
  const std::uint64_t num_settling = session.num_settling;
  RawNoise next;
  next.load(noise, lane);
  for (std::uint32_t k = 0; k < portion.count; ++k) {
    forget_memory();
    const RawNoise raw = next;
    noise += noise_sample_bytes;
    if (k + 1 < portion.count) next.load(noise, lane);
    const std::uint64_t n = portion.first + k;
    if (k % staged_samples == 0) {
      stage_samples<kind, num_lines>(session, n, portion.count - k, threads, *stage);
    }
    const bool is_recorded = n >= num_settling;
    const std::uint64_t i = is_recorded ? n - num_settling : n;
    if (is_recorded && i == 0) loop.begin_record();
    const SharedSample& sample = stage->samples[k % staged_samples];
    auto own = load_words<LoopConstants<double>>(constants, lane);
    const Observation<double> observation =
        loop.template advance<kind.masses>(own, shared.drag_free, shared.attitude, sample,
                                           raw.shaped(shared), i % 4 == 0 ? Watch::yes : Watch::no);
    if (!is_recorded) continue;
    const auto values = ground_signals(observation, sample, product);
    add_sample(values, stage->weights[k % staged_samples], 2 * num_lines, product, recorded, sums);
    if (kind.monitoring == Monitoring::on) {
      monitor.add(own.sensors, observation, stage->residual[k % staged_samples]);
      if ((i + 1) % LineWeights::block_size == 0) {
        monitor.end_block(i + 1 == LineWeights::block_size);
      }
    }
  }

  store_words(loop, loop_words, lane);
  for_each_sum<kind, num_lines>(
      [&](std::size_t s, std::size_t i) { sum_memory[sum_index(s, i)] = sums[s][i]; });
  if (kind.monitoring == Monitoring::on) store_words(monitor, monitor_words, lane);
}

/// advance_lane() of the session's kind.
template <std::size_t kind = 0>
PROOFMASS_INLINE void advance_lane_of(const Block& block, std::size_t lane) {
  if (block.session.kind != kind) {
    if constexpr (kind + 1 < sample_kinds.size()) advance_lane_of<kind + 1>(block, lane);
  } else if (block.session.num_lines == 1) {
    advance_lane<sample_kinds[kind], 1>(block, lane);
  } else {
    advance_lane<sample_kinds[kind], 2>(block, lane);
  }
}

}  // namespace proofmass::gpu
