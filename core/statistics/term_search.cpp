#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>

#include "core/statistics/detail/check.hpp"
#include "core/statistics/distribution.hpp"
#include "core/statistics/moments.hpp"
#include "core/statistics/sensitivity.hpp"

namespace proofmass {
namespace {

using Values = std::vector<double>;

/// Sums of four values at a time, in an order that depends on nothing but their number.
struct Moments2 {
  double sum = 0.0;
  double square = 0.0;
  double with_output = 0.0;
};

Moments2 moments_of_product(Column x, Column y, Column output) {
  constexpr std::size_t width = 4;
  std::array<double, width> sum{}, square{}, with_output{};
  const std::size_t end = x.size() - x.size() % width;
  for (std::size_t i = 0; i < end; i += width) {
    for (std::size_t k = 0; k < width; ++k) {
      const double product = x[i + k] * y[i + k];
      sum[k] += product;
      square[k] += product * product;
      with_output[k] += product * output[i + k];
    }
  }
  for (std::size_t i = end; i < x.size(); ++i) {
    const double product = x[i] * y[i];
    sum[0] += product;
    square[0] += product * product;
    with_output[0] += product * output[i];
  }
  const auto total = [](const std::array<double, width>& of) {
    return (of[0] + of[1]) + (of[2] + of[3]);
  };
  return {total(sum), total(square), total(with_output)};
}

Values centred(Column column) {
  Values values(column.begin(), column.end());
  for (int round = 0; round < 2; ++round) {
    const double mean = compensated_sum(values) / static_cast<double>(values.size());
    for (double& value : values) value -= mean;
  }
  return values;
}

double dot(Column a, Column b) {
  CompensatedSum sum;
  for (std::size_t i = 0; i < a.size(); ++i) sum.add(a[i] * b[i]);
  return sum.value();
}

/// Subtracts the projection on a column.
void remove(Column column, Values& values) {
  const double square = dot(column, column);
  if (square <= 0.0) return;
  const double factor = dot(column, values) / square;
  for (std::size_t i = 0; i < values.size(); ++i) values[i] -= factor * column[i];
}

/// Centred, with what is beyond two standard deviations brought there: what is far out counts, but
/// no sum of products is of a few values alone. With 1.5 deviations, among inputs that are 1 in a
/// fifth of the runs chance is taken for a term eight times too often.
Values limited(const Values& values) {
  Values result = centred(values);
  const double limit = 2.0 * std::sqrt(dot(result, result) / static_cast<double>(result.size()));
  for (double& value : result) value = std::clamp(value, -limit, limit);
  return centred(result);
}

/// Σx⁴/n over (Σx²/n)² of centred values, whatever their unit.
double kurtosis_of(const Values& values) {
  const auto n = static_cast<double>(values.size());
  const double mean_square = dot(values, values) / n;
  double sum = 0.0;
  for (const double value : values) {
    const double ratio = value * value / mean_square;
    sum += ratio * ratio;
  }
  return sum / n;
}

/// Inputs and products of two of so many.
double num_terms_of(std::size_t num_inputs) {
  const auto n = static_cast<double>(num_inputs);
  return n + 0.5 * n * (n + 1.0);
}

/// An input, or a product of two.
struct Candidate {
  std::size_t first = 0;
  std::optional<std::size_t> second;
  double squared_correlation = 0.0;
};

class TermSearch {
 public:
  TermSearch(std::span<const Column> inputs, Column output, std::size_t num_outputs)
      : num_outputs_(static_cast<double>(num_outputs)),
        output_(centred(output)),
        rest_(output_),
        variance_(dot(output_, output_)) {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const double largest = std::abs(
          *std::ranges::max_element(inputs[i], {}, [](double value) { return std::abs(value); }));
      if (!detail::varies(inputs[i])) continue;
      // Products of values in units of the largest one stay within the range of a double.
      Values scaled(inputs[i].begin(), inputs[i].end());
      for (double& value : scaled) value /= largest;
      columns_.push_back(factor_values(scaled));
      positions_.push_back(i);
      units_.push_back(largest);
    }
  }

  std::vector<ExplanatoryTerm> run(std::size_t num_max, double significance) {
    std::vector<ExplanatoryTerm> terms;
    if (variance_ <= 0.0) return terms;
    while (terms.size() < num_max) {
      std::optional<ExplanatoryTerm> term = next_term(significance);
      if (!term) break;
      terms.push_back(*term);
    }
    set_slopes(terms);
    return terms;
  }

 private:
  [[nodiscard]] Values values_of(const Candidate& candidate) const {
    Values values = columns_[candidate.first];
    if (candidate.second) {
      const Values& other = columns_[*candidate.second];
      for (std::size_t i = 0; i < values.size(); ++i) values[i] *= other[i];
    }
    return centred(values);
  }

  [[nodiscard]] Candidate assessed(std::size_t first, std::optional<std::size_t> second,
                                   const Values& ones) const {
    const Values& other = second ? columns_[*second] : ones;
    const Moments2 sums = moments_of_product(columns_[first], other, rest_);
    const double square = sums.square - sums.sum * sums.sum / static_cast<double>(rest_.size());
    // A product that hardly varies has no digits left.
    const bool varies = square > 1e-12 * sums.square;
    return {first, second, varies ? sums.with_output * sums.with_output / square : 0.0};
  }

  /// The best ones by correlation with what is left, in units of their share.
  [[nodiscard]] std::vector<Candidate> best_candidates() const {
    const Values ones(rest_.size(), 1.0);
    std::vector<Candidate> candidates;
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      candidates.push_back(assessed(i, std::nullopt, ones));
      for (std::size_t j = i; j < columns_.size(); ++j) candidates.push_back(assessed(i, j, ones));
    }
    std::ranges::stable_sort(candidates, std::greater<>(), &Candidate::squared_correlation);
    candidates.resize(std::min(candidates.size(), num_term_candidates));
    return candidates;
  }

  /// Two-sided, of one candidate alone. Not of ranks: where values are tied or one is far out, the
  /// factors that are taken away would order all others, and with them the ranks of both sides.
  [[nodiscard]] double p_value_of(const Candidate& candidate, Values values) const {
    Values rest = rest_;
    if (candidate.second) {
      std::vector<Values> factors{centred(columns_[candidate.first])};
      if (*candidate.second != candidate.first) {
        factors.push_back(centred(columns_[*candidate.second]));
        remove(factors[0], factors[1]);
      }
      for (const Values& factor : factors) {
        remove(factor, values);
        remove(factor, rest);
      }
    }
    const Values a = limited(values), b = limited(rest);
    CompensatedSum sum, squares;
    for (std::size_t i = 0; i < a.size(); ++i) {
      const double product = a[i] * b[i];
      sum.add(product);
      squares.add(product * product);
    }
    if (squares.value() <= 0.0) return 1.0;
    const double statistic = std::abs(sum.value()) / std::sqrt(squares.value());
    return std::min(2.0 * normal_cumulative(-statistic), 1.0);
  }

  std::optional<ExplanatoryTerm> next_term(double significance) {
    for (const Candidate& candidate : best_candidates()) {
      Values values = values_of(candidate);
      for (const Values& column : basis_) remove(column, values);
      const double square = dot(values, values);
      if (square <= 0.0) continue;
      const double product = dot(values, rest_);
      const double share = product * product / square / variance_;
      if (share < term_share_min) continue;
      const double p_value = std::min(num_outputs_ * num_terms_of(columns_.size()) *
                                          p_value_of(candidate, values_of(candidate)),
                                      1.0);
      if (p_value >= significance) continue;
      kept_.push_back(candidate);
      remove(values, rest_);
      basis_.push_back(std::move(values));
      ExplanatoryTerm term{.first = positions_[candidate.first],
                           .second = std::nullopt,
                           .slope = 0.0,
                           .share = share,
                           .p_value = p_value};
      if (candidate.second) term.second = positions_[*candidate.second];
      return term;
    }
    return std::nullopt;
  }

  // Of the fit of all terms: with Q the orthogonal columns and X = Q R, R slopes = Qᵀy/Q².
  void set_slopes(std::vector<ExplanatoryTerm>& terms) const {
    const auto count = static_cast<Eigen::Index>(terms.size());
    Eigen::MatrixXd r = Eigen::MatrixXd::Zero(count, count);
    Eigen::VectorXd projections(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const Values& column = basis_[static_cast<std::size_t>(i)];
      const double square = dot(column, column);
      projections[i] = dot(column, output_) / square;
      for (Eigen::Index j = i; j < count; ++j) {
        r(i, j) = dot(column, values_of(kept_[static_cast<std::size_t>(j)])) / square;
      }
    }
    const Eigen::VectorXd slopes = r.triangularView<Eigen::Upper>().solve(projections);
    for (std::size_t i = 0; i < terms.size(); ++i) {
      const double second_unit = kept_[i].second ? units_[*kept_[i].second] : 1.0;
      terms[i].slope = slopes[static_cast<Eigen::Index>(i)] / units_[kept_[i].first] / second_unit;
    }
  }

  double num_outputs_;
  std::vector<std::size_t> positions_;  ///< Of the inputs that vary.
  std::vector<double> units_;
  std::vector<Values> columns_;
  Values output_;
  Values rest_;
  double variance_;
  std::vector<Candidate> kept_;
  std::vector<Values> basis_;  ///< Values of these without the terms before.
};

}  // namespace

std::vector<double> factor_values(Column input) {
  constexpr double num_deviations = 4.0;
  const Moments moments = proofmass::moments(input);
  const double chance =
      num_deviations * moments.standard_deviation / std::sqrt(static_cast<double>(input.size()));
  Values values(input.begin(), input.end());
  if (std::abs(moments.mean) <= chance) return values;
  for (double& value : values) value -= moments.mean;
  return values;
}

std::vector<ExplanatoryTerm> explanatory_terms(std::span<const Column> inputs, Column output,
                                               std::size_t num_max, double confidence,
                                               std::size_t num_outputs) {
  detail::check_fraction("confidence", confidence);
  detail::check_values("output", output, sensitivity_values_min);
  for (const Column input : inputs) {
    detail::check_same_size("input", input, output);
    detail::check_values("input", input, sensitivity_values_min);
  }
  return TermSearch(inputs, output, num_outputs).run(num_max, 1.0 - confidence);
}

double term_share_found(std::span<const Column> inputs, double confidence,
                        std::size_t num_outputs) {
  detail::check_fraction("confidence", confidence);
  std::size_t num_inputs = 0;
  double sum = 0.0;
  for (const Column input : inputs) {
    if (!detail::varies(input)) continue;
    ++num_inputs;
    sum += kurtosis_of(limited(factor_values(input)));
  }
  if (num_inputs == 0) return 1.0;
  const double kurtosis = sum / static_cast<double>(num_inputs);
  const double significance =
      (1.0 - confidence) / static_cast<double>(num_outputs) / num_terms_of(num_inputs);
  const double square = chi_square_quantile(1.0 - significance, 1.0);  // Of a normal deviate.
  const double rest = static_cast<double>(inputs.front().size()) - (kurtosis - 1.0) * square;
  if (rest <= 0.0) return std::numeric_limits<double>::infinity();
  return std::max(square / rest, term_share_min);
}

}  // namespace proofmass
