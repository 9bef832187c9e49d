#include "core/signal/line_weights.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "core/error.hpp"
#include "core/math/elementary.hpp"
#include "core/math/inline.hpp"

namespace proofmass {
namespace {

/// Σ over k in [first, last) of e^{2πi·turns·k}, from the geometric series.
std::complex<double> phasor_sum(double turns, std::size_t first, std::size_t last) {
  const auto count = static_cast<double>(last - first);
  const double middle = 0.5 * (static_cast<double>(first) + static_cast<double>(last) - 1.0);
  const double step = sincos_turns(0.5 * turns).sine;
  // Equal lines: the limit of the quotient.
  const double length =
      std::abs(step) < 1e-15 ? count : sincos_turns(0.5 * turns * count).sine / step;
  const auto [sine, cosine] = sincos_turns(turns * middle);
  return {length * cosine, length * sine};
}

/// ΦᵀΦ of cosine and sine of all lines over the kept samples, in closed form.
Eigen::MatrixXd gram_matrix(const LineFit& fit, const std::vector<double>& lines_hz) {
  const auto n = static_cast<Eigen::Index>(lines_hz.size());
  Eigen::MatrixXd gram(2 * n, 2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const double a = lines_hz[static_cast<std::size_t>(i)] * fit.sample_period_s;
      const double b = lines_hz[static_cast<std::size_t>(j)] * fit.sample_period_s;
      const auto difference = phasor_sum(a - b, fit.num_dropped, fit.num_samples);
      const auto sum = phasor_sum(a + b, fit.num_dropped, fit.num_samples);
      gram(2 * i, 2 * j) = 0.5 * (difference.real() + sum.real());
      gram(2 * i, 2 * j + 1) = 0.5 * (sum.imag() - difference.imag());
      gram(2 * i + 1, 2 * j) = 0.5 * (sum.imag() + difference.imag());
      gram(2 * i + 1, 2 * j + 1) = 0.5 * (difference.real() - sum.real());
    }
  }
  return gram;
}

}  // namespace

LineWeights::Marks::Marks(std::size_t first, std::size_t count)
    : first_block(first), num_blocks(count), stride((count + num_marks_max - 1) / num_marks_max) {}

bool LineWeights::Marks::is_end_of_stretch(std::size_t block) const {
  const std::size_t next = block + 1 - first_block;
  return next == num_blocks || next % stride == 0;
}

std::size_t LineWeights::Marks::stretch_of(std::size_t block) const {
  return (block - first_block) / stride;
}

LineWeights::LineWeights(const LineFit& fit) : fit_(fit), lines_hz_(fit.fit_hz) {
  lines_hz_.insert(lines_hz_.end(), fit.known_hz.begin(), fit.known_hz.end());
  if (fit.num_samples < fit.num_dropped + 2 * lines_hz_.size()) {
    throw InvalidArgument(fmt::format("line fit: {} samples kept of {} are fewer than {} unknowns",
                                      fit.num_samples - std::min(fit.num_dropped, fit.num_samples),
                                      fit.num_samples, 2 * lines_hz_.size()));
  }
  PROOFMASS_EXPECT(fit.fit_hz.size() <= 2 && lines_hz_.size() <= num_lines_max);
  marks_ = Marks(0, (fit_.num_samples + block_size - 1) / block_size);
  if (fit.fit_hz.empty()) return;
  solve_design();

  const std::size_t num_outputs = 2 * num_fit_lines();
  means_.assign(num_outputs, 0.0);
  States states{};
  std::vector<double> weights(block_size * num_outputs);
  std::vector<double> sums(num_outputs, 0.0);
  for (std::size_t block = num_blocks(); block-- > 0;) {
    if (marks_.is_end_of_stretch(block)) marks_.ends[marks_.stretch_of(block)] = states;
    run_backwards(block, states, weights);
    for (std::size_t i = 0; i < samples_in(block) * num_outputs; ++i) {
      sums[i % num_outputs] += weights[i];
    }
  }
  for (std::size_t i = 0; i < num_outputs; ++i) {
    means_[i] = sums[i] / static_cast<double>(fit_.num_samples);
  }
}

void LineWeights::solve_design() {
  const Eigen::MatrixXd gram = gram_matrix(fit_, lines_hz_);
  const Eigen::LDLT<Eigen::MatrixXd> factors(gram);
  const Eigen::VectorXd pivots = factors.vectorD();
  if (factors.info() != Eigen::Success || pivots.minCoeff() < 1e-10 * pivots.maxCoeff()) {
    throw InvalidArgument("line fit: two lines are too close to be told apart in the record");
  }
  const auto num_outputs = static_cast<Eigen::Index>(2 * num_fit_lines());
  const Eigen::MatrixXd columns =
      factors.solve(Eigen::MatrixXd::Identity(gram.rows(), num_outputs));
  coefficients_.resize(static_cast<std::size_t>(columns.size()));
  for (Eigen::Index row = 0; row < columns.rows(); ++row) {
    for (Eigen::Index output = 0; output < num_outputs; ++output) {
      coefficients_[static_cast<std::size_t>(row * num_outputs + output)] = columns(row, output);
    }
  }
}

std::size_t LineWeights::samples_in(std::size_t block) const {
  return std::min(block_size, fit_.num_samples - block * block_size);
}

namespace {

/// Cosines and sines of all lines at a sample, and the rotation to the one before.
struct RotatingLines {
  std::size_t num_lines = 0;
  alignas(32) std::array<double, LineWeights::num_lines_max> sine{}, cosine{};
  alignas(32) std::array<double, LineWeights::num_lines_max> step_sine{}, step_cosine{};
};

/// Lines at sample `last`. They are set anew in every block, so that the rounding of their rotation
/// cannot grow past block_size steps.
RotatingLines lines_at(const std::vector<double>& lines_hz, double sample_period_s,
                       std::size_t last) {
  RotatingLines lines;
  lines.num_lines = lines_hz.size();
  for (std::size_t i = 0; i < lines.num_lines; ++i) {
    const double turns = lines_hz[i] * sample_period_s;
    const SineCosine now = sincos_turns(turns * static_cast<double>(last));
    const SineCosine step = sincos_turns(turns);
    lines.sine[i] = now.sine;
    lines.cosine[i] = now.cosine;
    lines.step_sine[i] = step.sine;
    lines.step_cosine[i] = step.cosine;
  }
  return lines;
}

template <std::size_t num_doubles>
struct VectorOf {
  using Type [[gnu::vector_size(num_doubles * sizeof(double))]] = double;
};

// No function takes or returns such a vector: how is different with longer registers.
template <typename V>
PROOFMASS_INLINE void load(V& vector, const double* from) {
  std::memcpy(&vector, from, sizeof(vector));
}
template <typename V>
PROOFMASS_INLINE void store(const V& vector, double* to) {
  std::memcpy(to, &vector, sizeof(vector));
}

/// Goes to the sample before, four lines at a time.
PROOFMASS_INLINE void turn_back(RotatingLines& lines) {
  using Four = VectorOf<4>::Type;
  for (std::size_t i = 0; i < lines.num_lines; i += 4) {
    Four sine, cosine, step_sine, step_cosine;
    load(sine, &lines.sine[i]);
    load(cosine, &lines.cosine[i]);
    load(step_sine, &lines.step_sine[i]);
    load(step_cosine, &lines.step_cosine[i]);
    store(sine * step_cosine - cosine * step_sine, &lines.sine[i]);
    store(cosine * step_cosine + sine * step_sine, &lines.cosine[i]);
  }
}

/// A block of samples, of which the first ones may be dropped.
struct FilteredBlock {
  const BandPass& filter;
  const double* coefficients;
  std::size_t num_samples;
  std::size_t num_dropped;
};

/// Filters Φ (ΦᵀΦ)⁻¹ backwards from the end of a block to its start, all outputs in a vector.
template <std::size_t num_outputs>
PROOFMASS_INLINE void filter_block(const FilteredBlock& block, RotatingLines lines,
                                   BandPassState* states, double* weights) {
  using V = typename VectorOf<num_outputs>::Type;
  const BandPass filter = block.filter;
  BandPassStateOf<V> state;
  for (std::size_t i = 0; i < num_outputs; ++i) {
    state.high_pass.s1[i] = states[i].high_pass.s1;
    state.high_pass.s2[i] = states[i].high_pass.s2;
    state.low_pass.s1[i] = states[i].low_pass.s1;
    state.low_pass.s2[i] = states[i].low_pass.s2;
  }
  for (std::size_t k = block.num_samples; k-- > 0;) {
    V row{};
    const double* coefficient = block.coefficients;
    for (std::size_t line = 0; line < lines.num_lines; ++line) {
      V of_cosine, of_sine;
      load(of_cosine, coefficient);
      load(of_sine, coefficient + num_outputs);
      row += lines.cosine[line] * of_cosine + lines.sine[line] * of_sine;
      coefficient += 2 * num_outputs;
    }
    turn_back(lines);
    V output = (k >= block.num_dropped ? 1.0 : 0.0) * row;
    state.filter(filter, output);
    store(output, weights + k * num_outputs);
  }
  for (std::size_t i = 0; i < num_outputs; ++i) {
    states[i] = {{state.high_pass.s1[i], state.high_pass.s2[i]},
                 {state.low_pass.s1[i], state.low_pass.s2[i]}};
  }
}

template <std::size_t num_outputs>
void filter_backwards(const FilteredBlock& block, const RotatingLines& lines, BandPassState* states,
                      double* weights) {
  filter_block<num_outputs>(block, lines, states, weights);
}

#if defined(__x86_64__)
// filter_block() in longer vectors, which halve its time; contraction is off, and the bits are
// equal.
template <std::size_t num_outputs>
[[gnu::target("avx2")]] void filter_backwards_avx2(const FilteredBlock& block,
                                                   const RotatingLines& lines,
                                                   BandPassState* states, double* weights) {
  filter_block<num_outputs>(block, lines, states, weights);
}
#endif

using Filter = void (*)(const FilteredBlock&, const RotatingLines&, BandPassState*, double*);

template <std::size_t num_outputs>
Filter best_filter() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) return filter_backwards_avx2<num_outputs>;
#endif
  return filter_backwards<num_outputs>;
}

}  // namespace

void LineWeights::run_backwards(std::size_t block, States& states,
                                std::span<double> weights) const {
  const std::size_t first = block * block_size;
  const std::size_t num_samples = samples_in(block);
  const RotatingLines lines = lines_at(lines_hz_, fit_.sample_period_s, first + num_samples - 1);
  static const Filter one_line = best_filter<2>(), two_lines = best_filter<4>();
  const FilteredBlock filtered{.filter = fit_.filter,
                               .coefficients = coefficients_.data(),
                               .num_samples = num_samples,
                               .num_dropped = fit_.num_dropped - std::min(fit_.num_dropped, first)};
  (num_fit_lines() == 1 ? one_line : two_lines)(filtered, lines, states.data(), weights.data());
}

void LineWeights::refine(const Marks& coarse, std::size_t stretch, Marks& fine,
                         std::span<double> scratch) const {
  const std::size_t first = coarse.first_block + stretch * coarse.stride;
  const std::size_t end = std::min(first + coarse.stride, coarse.first_block + coarse.num_blocks);
  fine = Marks(first, end - first);
  States states = coarse.ends[stretch];
  for (std::size_t block = end; block-- > first;) {
    if (fine.is_end_of_stretch(block)) fine.ends[fine.stretch_of(block)] = states;
    run_backwards(block, states, scratch);
  }
}

void WeightReader::fill_block(std::size_t block, std::span<double> weights) {
  const std::size_t num_outputs = weights_.means_.size();
  if (num_outputs == 0) return;
  const std::size_t num_samples = weights_.samples_in(block);
  PROOFMASS_EXPECT(weights.size() >=
                   num_outputs * std::min(weights_.num_samples(), LineWeights::block_size));
  const LineWeights::Marks* marks = &weights_.marks_;
  for (LineWeights::Marks& finer : levels_) {
    if (marks->stride == 1) break;
    const std::size_t stretch = marks->stretch_of(block);
    const std::size_t first = marks->first_block + stretch * marks->stride;
    if (finer.num_blocks == 0 || finer.first_block != first) {
      weights_.refine(*marks, stretch, finer, weights);
    }
    marks = &finer;
  }
  LineWeights::States states = marks->ends[marks->stretch_of(block)];
  weights_.run_backwards(block, states, weights);
  for (std::size_t k = 0; k < num_samples; ++k) {
    for (std::size_t i = 0; i < num_outputs; ++i) {
      weights[k * num_outputs + i] -= weights_.means_[i];
    }
  }
}

}  // namespace proofmass
