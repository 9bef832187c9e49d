#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <span>
#include <vector>

#include "core/signal/band_pass.hpp"

namespace proofmass {

/// How the phasors of a record's lines are estimated ([Hardy2013] section 5.2): remove the mean,
/// band-pass, drop the filter's transient, then least squares on cosine and sine of all lines.
struct LineFit {
  std::size_t num_samples = 0;  ///< Of the record; its first sample is at t = 0.
  std::size_t num_dropped = 0;  ///< Filtered samples dropped at the start, < num_samples.
  double sample_period_s = 0.25;
  BandPass filter{};
  std::vector<double> fit_hz;    ///< Lines whose phasors are wanted: two at most.
  std::vector<double> known_hz;  ///< Further lines; at most LineWeights::num_lines_max in all.
};

/// The estimate of a LineFit as one weighted sum over the raw record.
///
/// Every step of the estimate is linear, so the amplitudes of a line's cosine and sine are Σ wₖ xₖ
/// with weights that depend on the record's length and the lines alone, not on the signal. They are
///
///     w = (I − 11ᵀ/N) Fᵀ D Φ (ΦᵀΦ)⁻¹
///
/// with Φ the lines on the samples kept, D the dropping and F the filter; Fᵀ is the same filter run
/// backwards in time. So no signal is ever filtered and none is stored: a signal costs two
/// multiplications a sample and line. A WeightReader makes the weights block by block, forwards,
/// from the filter's states at the ends of a fixed number of stretches.
class LineWeights {
 public:
  static constexpr std::size_t block_size = 2048;
  static constexpr std::size_t num_lines_max = 40;

  /// @throws InvalidArgument if fewer samples are kept than the fit has unknowns, or if two lines
  ///         cannot be told apart.
  explicit LineWeights(const LineFit& fit);

  [[nodiscard]] std::size_t num_samples() const { return fit_.num_samples; }
  [[nodiscard]] std::size_t num_blocks() const { return marks_.num_blocks; }
  [[nodiscard]] std::size_t num_fit_lines() const { return fit_.fit_hz.size(); }
  /// Samples of block `block`: block_size, fewer in the last one.
  [[nodiscard]] std::size_t samples_in(std::size_t block) const;

 private:
  friend class WeightReader;

  /// Filter memory of each output (cosine and sine of one or two fit lines), running backwards.
  using States = std::array<BandPassState, 4>;

  /// As many as a record of 20 orbits at 4 Hz has blocks, so that its weights take one pass.
  static constexpr std::size_t num_marks_max = 256;

  /// States at the ends of the stretches into which consecutive blocks are cut. Their number has a
  /// bound, so that the memory does not grow with the record.
  struct Marks {
    std::size_t first_block = 0;
    std::size_t num_blocks = 0;
    std::size_t stride = 0;                    ///< Blocks in a stretch, fewer in the last.
    std::array<States, num_marks_max> ends{};  ///< On entering each stretch from its end.

    Marks() = default;
    Marks(std::size_t first_block, std::size_t num_blocks);
    [[nodiscard]] bool is_end_of_stretch(std::size_t block) const;
    [[nodiscard]] std::size_t stretch_of(std::size_t block) const;
  };

  void solve_design();
  void run_backwards(std::size_t block, States& states, std::span<double> weights) const;
  /// Marks of one stretch of coarser ones.
  void refine(const Marks& coarse, std::size_t stretch, Marks& fine,
              std::span<double> scratch) const;

  LineFit fit_;
  std::vector<double> lines_hz_;      ///< fit_hz, then known_hz.
  std::vector<double> coefficients_;  ///< Of (ΦᵀΦ)⁻¹: [line][cosine, sine][output].
  std::vector<double> means_;         ///< Mean raw weight of each output.
  Marks marks_;                       ///< Of the whole record.
};

/// Makes line weights block by block. Where a stretch has several blocks it runs the filter through
/// it once more, to mark their ends; so blocks in ascending order cost the least.
class WeightReader {
 public:
  /// @param weights  Outlives the reader.
  explicit WeightReader(const LineWeights& weights) : weights_(weights) {}

  [[nodiscard]] const LineWeights& weights() const { return weights_; }

  /// Writes the weights of samples [block·block_size, …), sample after sample, for each line of
  /// fit_hz first the cosine's then the sine's: shape [samples_in(block)][2·num_fit_lines()].
  void fill_block(std::size_t block, std::span<double> weights);

 private:
  /// Enough for 256³ blocks, 270 years at 4 Hz.
  static constexpr std::size_t num_levels = 2;

  const LineWeights& weights_;
  std::array<LineWeights::Marks, num_levels> levels_;  ///< Each of one stretch of that before it.
};

}  // namespace proofmass
