#pragma once

// A kernel for one run or a few, of which several sessions are computed side by side: a lane is a
// session of a run. See batch_kernel-inl.hpp.

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/microscope/simulation/batch-inl.hpp"
#include "core/microscope/simulation/batch_gather-inl.hpp"
#include "core/microscope/simulation/batch_kernel.hpp"
#include "core/microscope/simulation/batch_noise-inl.hpp"
#include "core/microscope/simulation/batch_signals-inl.hpp"

namespace proofmass {
namespace {

/// Streams and blocks of lanes that are in different sessions.
class LaneStreams {
 public:
  /// Sets a lane to the first block of a session.
  void begin(std::size_t lane, const NoiseStreams& streams) {
    for (std::size_t channel = 0; channel < num_noise_channels; ++channel) {
      streams_[channel][lane] = streams[channel];
    }
    blocks_[lane] = 0;
  }
  HWY_INLINE hn::Vec<Words> stream(std::size_t channel) const {
    return hn::Load(Words(), streams_[channel]);
  }
  HWY_INLINE hn::Vec<Words> block() const { return hn::Load(Words(), blocks_); }
  HWY_INLINE void next_block() {
    hn::Store(hn::Add(block(), hn::Set(Words(), 1U)), Words(), blocks_);
  }

 private:
  alignas(64) std::uint64_t streams_[num_noise_channels][num_lanes] = {};
  alignas(64) std::uint64_t blocks_[num_lanes] = {};
};

/// The products that the lanes record.
class LaneProducts {
 public:
  void set(std::size_t lane, Product product) {
    for (std::size_t i = 0; i < is_.size(); ++i) {
      put_lane(is_[i], i == static_cast<std::size_t>(product) ? 1.0 : 0.0, lane);
    }
  }
  HWY_INLINE Batch choose(const Batch& others, Product product, const Batch& value) const {
    const Batch& is_this = is_[static_cast<std::size_t>(product)];
    Batch chosen;
    for (std::size_t i = 0; i < num_vectors; ++i) {
      const auto mask = hn::Gt(is_this.part[i], hn::Zero(Doubles()));
      chosen.part[i] = hn::IfThenElse(mask, value.part[i], others.part[i]);
    }
    return chosen;
  }

 private:
  std::array<Batch, static_cast<std::size_t>(Product::modulated_zz) + 1> is_{};  ///< 1 or 0.
};

/// product_signal() of each lane.
template <typename T>
HWY_INLINE T product_signal(const LaneProducts& kinds, const T& common_x, const T& sensor_1_x,
                            const T& sensor_2_x, const std::array<Vector3<T>, 3>& g,
                            const T& motion) {
  Batch product(0.0);
  for (const Product kind :
       {Product::common_squared, Product::sensor_1_squared, Product::sensor_2_squared,
        Product::modulated_yy, Product::modulated_zz}) {
    product = kinds.choose(
        product, kind, product_signal<Batch>(kind, common_x, sensor_1_x, sensor_2_x, g, motion));
  }
  return product;
}

/// Sessions of the same runs, one after the other in each of several seats: a seat is a lane for
/// each run. Each session has the bits that it has alone.
///
/// Deviates come for four samples at a time, and the loops are watched in every fourth sample. So a
/// session begins where the count of all samples is a multiple of four; until then its seat idles.
class MixedLanes {
 public:
  /// @param sessions  In the order in which they begin.
  MixedLanes(std::span<const BatchSession> sessions, std::span<SessionOutcomes> outcomes)
      : sessions_(sessions),
        outcomes_(outcomes),
        lanes_a_seat_(std::bit_ceil(sessions[0].num_runs)),
        num_seats_(std::min(num_lanes / lanes_a_seat_, sessions.size())),
        num_steps_(steps_of(sessions, num_seats_)),
        num_record_samples_(record_samples_of(sessions)),
        noise_(with_runs_in_seats(sessions[0], lanes_a_seat_), LaneStreams(), 0, {}) {
    for (std::size_t s = 0; s < num_seats_; ++s) begin_next(s);
  }

  HWY_INLINE void run() {
    while (num_ended_ < sessions_.size()) {
      std::size_t num_samples = samples_a_step;
      for (std::size_t s = 0; s < num_seats_; ++s) {
        num_samples = std::min(num_samples, samples_to_event(seats_[s]));
      }
      is_any_recording_ = false;
      for (std::size_t s = 0; s < num_seats_; ++s) fill_weights(s, num_samples);
      advance(num_samples);
      num_samples_ += num_samples;
      for (std::size_t s = 0; s < num_seats_; ++s) pass(s, num_samples);
      report();
    }
  }

 private:
  static constexpr std::size_t samples_a_step = 256;
  static constexpr std::size_t num_outputs = 2 * num_fit_lines_max;
  static constexpr std::size_t num_loop_numbers =
      offsetof(Loop<double>, is_any_saturated) / sizeof(double);

  struct Seat {
    const BatchSession* session = nullptr;  ///< Null while it idles.
    std::size_t index = 0;                  ///< Of the session.
    std::optional<BatchSignals> signals{};
    bool is_recording = false;
    std::size_t block = 0;
    std::size_t num_done = 0;  ///< Samples of the settling, or of the block.
    BlockWeights weights{};
  };

  /// Of one sample and all lanes.
  struct Weights {
    std::array<Batch, num_outputs> lines{};
    std::array<Batch, 2> residual{};
  };

  [[nodiscard]] static BatchSession with_runs_in_seats(const BatchSession& session,
                                                       std::size_t lanes_a_seat) {
    BatchSession in_seats = session;
    for (std::size_t lane = 0; lane < num_lanes; ++lane) {
      in_seats.runs[lane] = session.runs[lane % lanes_a_seat];
    }
    return in_seats;
  }

  /// Samples of a lane until all sessions have ended, each begun in the seat that is free first.
  [[nodiscard]] static std::size_t steps_of(std::span<const BatchSession> sessions,
                                            std::size_t num_seats) {
    std::array<std::size_t, num_lanes> ends{};
    std::size_t last = 0;
    for (const BatchSession& session : sessions) {
      std::size_t first_free = 0;
      for (std::size_t s = 1; s < num_seats; ++s) {
        if (ends[s] < ends[first_free]) first_free = s;
      }
      std::size_t& end = ends[first_free];
      end += (samples_per_noise_block - end % samples_per_noise_block) % samples_per_noise_block;
      end += static_cast<std::size_t>(session.signals->num_settling()) +
             session.setup.reader->weights().num_samples();
      last = std::max(last, end);
    }
    return last;
  }

  [[nodiscard]] static std::size_t record_samples_of(std::span<const BatchSession> sessions) {
    std::size_t count = 0;
    for (const BatchSession& session : sessions) {
      count += session.setup.reader->weights().num_samples();
    }
    return count;
  }

  template <typename Function>
  HWY_INLINE void for_lanes_of(std::size_t seat, const Function& function) {
    // Lanes beyond the last seat do what it does.
    const std::size_t end = seat + 1 == num_seats_ ? num_lanes : (seat + 1) * lanes_a_seat_;
    for (std::size_t lane = seat * lanes_a_seat_; lane < end; ++lane) {
      function(lane, lane % lanes_a_seat_);
    }
  }

  [[nodiscard]] static std::size_t length(const Seat& seat) {
    return seat.is_recording ? seat.session->setup.reader->weights().samples_in(seat.block)
                             : static_cast<std::size_t>(seat.signals->num_settling());
  }

  [[nodiscard]] std::size_t samples_to_event(const Seat& seat) const {
    if (seat.session != nullptr) return length(seat) - seat.num_done;
    const bool can_begin = num_begun_ < sessions_.size();
    return can_begin ? samples_per_noise_block - num_samples_ % samples_per_noise_block
                     : samples_a_step;
  }

  void begin_next(std::size_t s) {
    Seat& seat = seats_[s];
    seat.index = num_begun_++;
    seat.session = &sessions_[seat.index];
    seat.signals.emplace(*seat.session->signals);
    seat.is_recording = false;
    seat.num_done = 0;
    Loop<double> loop;
    loop.begin(seat.signals->reference_at_start());
    for_lanes_of(s, [&](std::size_t lane, std::size_t run) {
      put_lane(loop_, loop, lane, num_loop_numbers);
      put_lane(noise_.states(), seat.session->noise_states[run], lane);
      noise_.streams().begin(lane, *seat.session->streams);
      lane_constants_[lane] = seat.session->constants[run];
      products_.set(lane, seat.session->setup.product);
    });
    constants_ = gather_constants(lane_constants_);
    if (length(seat) == 0) begin_record(s);
  }

  void begin_record(std::size_t s) {
    Seat& seat = seats_[s];
    seat.is_recording = true;
    seat.block = 0;
    for_lanes_of(s, [&](std::size_t lane, std::size_t /*run*/) {
      put_lane(loop_.largest_acceleration, 0.0, lane);
      put_lane(loop_.largest_angle, 0.0, lane);
      put_lane(sums_, SignalSums<double>{}, lane);
      put_lane(monitor_, LoopMonitor<double>{}, lane);
    });
    begin_block(seat);
  }

  static void begin_block(Seat& seat) {
    seat.num_done = 0;
    seat.weights = fill_block(seat.session->setup, seat.block, seat.session->weights_buffer);
  }

  /// Of the next samples; 0 in lanes that record nothing.
  HWY_NOINLINE void fill_weights(std::size_t s, std::size_t num_samples) {
    const Seat& seat = seats_[s];
    const bool records = seat.session != nullptr && seat.is_recording;
    if (records) is_any_recording_ = true;
    const std::size_t num_used =
        records ? 2 * seat.session->setup.reader->weights().num_fit_lines() : 0;
    const bool has_residual = records && seat.weights.residual != nullptr;
    for_lanes_of(s, [&](std::size_t lane, std::size_t /*run*/) {
      for (std::size_t k = 0; k < num_samples; ++k) {
        for (std::size_t i = 0; i < num_outputs; ++i) {
          const std::size_t at = (seat.num_done + k) * num_used + i;
          put_lane(weights_[k].lines[i], i < num_used ? seat.weights.lines[at] : 0.0, lane);
        }
        for (std::size_t i = 0; i < 2; ++i) {
          const std::size_t at = 2 * (seat.num_done + k) + i;
          put_lane(weights_[k].residual[i], has_residual ? seat.weights.residual[at] : 0.0, lane);
        }
      }
    });
  }

  HWY_INLINE void next_shared(SharedSampleOf<Batch>& shared) {
    for (std::size_t s = 0; s < num_seats_; ++s) {
      Seat& seat = seats_[s];
      if (seat.session == nullptr) continue;  // The last one will do.
      const SharedSample& sample = seat.signals->next();
      for_lanes_of(s,
                   [&](std::size_t lane, std::size_t /*run*/) { put_lane(shared, sample, lane); });
    }
  }

  HWY_NOINLINE void advance(std::size_t num_samples) {
    const SessionSetup& setup = sessions_[0].setup;  // Its gains are those of all.
    for (std::size_t k = 0; k < num_samples; ++k) {
      next_shared(shared_);
      const bool is_watched = (num_samples_ + k) % samples_per_noise_block == 0;
      const auto observation = loop_.advance(constants_, setup.drag_free, setup.attitude, shared_,
                                             noise_.next(), is_watched ? Watch::yes : Watch::no);
      if (!is_any_recording_) continue;
      const auto values = ground_signals(observation, shared_, products_);
      // Any product stands for those of the lanes.
      add_sample(values, weights_[k].lines.data(), num_outputs, Product::common_squared,
                 SignalSet::all, sums_);
      monitor_.add(constants_.sensors, observation, weights_[k].residual.data());
    }
  }

  /// Goes on after these samples.
  void pass(std::size_t s, std::size_t num_samples) {
    Seat& seat = seats_[s];
    if (seat.session == nullptr) {
      if (num_begun_ < sessions_.size() && num_samples_ % samples_per_noise_block == 0) {
        begin_next(s);
      }
      return;
    }
    seat.num_done += num_samples;
    if (seat.num_done < length(seat)) return;
    if (seat.is_recording) {
      end_block(s);
    } else {
      begin_record(s);
    }
  }

  /// Reports the part of the steps that is done. The samples recorded so far would promise too
  /// much: towards the end, some seats idle, and a step records fewer.
  void report() {
    const double part = static_cast<double>(num_samples_) / static_cast<double>(num_steps_);
    const auto done = static_cast<std::size_t>(part * static_cast<double>(num_record_samples_));
    sessions_[0].progress(sessions_[0].progress_context,
                          num_samples_ == num_steps_ ? num_record_samples_ : done);
  }

  void end_block(std::size_t s) {
    Seat& seat = seats_[s];
    const LineWeights& weights = seat.session->setup.reader->weights();
    // A block that is not full has a sum of its own size.
    if (seat.num_done == LineWeights::block_size) {
      for_lanes_of(s, [&](std::size_t lane, std::size_t /*run*/) {
        auto monitor = lane_of<LoopMonitor<double>>(monitor_, lane);
        monitor.end_block(seat.block == 0);
        put_lane(monitor_, monitor, lane);
      });
    }
    if (++seat.block < weights.num_blocks()) return begin_block(seat);
    end_session(s);
  }

  void end_session(std::size_t s) {
    Seat& seat = seats_[s];
    for (std::size_t run = 0; run < seat.session->num_runs; ++run) {
      const std::size_t lane = s * lanes_a_seat_ + run;
      SessionOutcome& outcome = outcomes_[seat.index][run];
      outcome.sums = lane_of<SignalSums<double>>(sums_, lane);
      outcome.health.acceleration_m_s2 = lane_of<double>(loop_.largest_acceleration, lane);
      outcome.health.attitude_rad = lane_of<double>(loop_.largest_angle, lane);
      if (seat.session->setup.residual_reader == nullptr) continue;
      outcome.health.monitor = lane_of<LoopMonitor<double>>(monitor_, lane);
    }
    seat.session = nullptr;
    ++num_ended_;
    pass(s, 0);
  }

  std::span<const BatchSession> sessions_;
  std::span<SessionOutcomes> outcomes_;
  std::size_t lanes_a_seat_;
  std::size_t num_seats_;
  std::size_t num_steps_;           ///< In all, as num_samples_ counts.
  std::size_t num_record_samples_;  ///< Of the records of all sessions.
  std::size_t num_begun_ = 0;
  std::size_t num_ended_ = 0;
  std::size_t num_samples_ = 0;  ///< Of every lane.
  bool is_any_recording_ = false;

  std::array<Seat, num_lanes> seats_{};
  std::array<LoopConstants<double>, num_lanes> lane_constants_{};
  LoopConstants<Batch> constants_{};
  LaneProducts products_;
  BatchNoise<LaneStreams> noise_;
  SharedSampleOf<Batch> shared_{};
  Loop<Batch> loop_{};
  SignalSums<Batch> sums_{};
  LoopMonitor<Batch> monitor_{};
  std::array<Weights, samples_a_step> weights_{};
};

}  // namespace
}  // namespace proofmass
