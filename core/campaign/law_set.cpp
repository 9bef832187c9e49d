#include "core/campaign/law_set.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "core/campaign/expression.hpp"
#include "core/error.hpp"
#include "core/random/sobol.hpp"
#include "core/statistics/independence.hpp"

namespace proofmass {

std::string LawSet::path_of(std::size_t quantity) const {
  return fmt::format("{}.{}", table, names[quantity]);
}

std::size_t LawSet::index_of(std::string_view name) const {
  return static_cast<std::size_t>(std::ranges::find(names, name) - names.begin());
}

std::vector<std::size_t> table_elements(std::span<const Dispersion> laws) {
  std::vector<std::size_t> elements;
  for (std::size_t i = 0; i < laws.size(); ++i) {
    if (laws[i].law == Law::table) elements.push_back(i);
  }
  return elements;
}

void check_table_columns(const LawSet& set, const Campaign& campaign) {
  const std::vector<std::size_t> elements = table_elements(set.laws);
  if (campaign.table_columns.size() != elements.size()) {
    throw ConfigError("dispersion", fmt::format("{} columns", campaign.table_columns.size()),
                      fmt::format("laws of kind table are {}", elements.size()));
  }
  for (std::size_t i = 0; i < elements.size(); ++i) {
    const std::vector<double>& column = campaign.table_columns[i];
    const auto refuse = [&](const std::string& rule) {
      throw ConfigError(set.path_of(elements[i]) + ".column",
                        fmt::format("\"{}\"", set.laws[elements[i]].column), rule);
    };
    if (column.size() < campaign.num_runs) {
      refuse(
          fmt::format("has values for {} runs, {} are needed", column.size(), campaign.num_runs));
    }
    const auto bad = std::ranges::find_if_not(column, [](double x) { return std::isfinite(x); });
    if (bad != column.end()) {
      refuse(fmt::format("row {} must be finite", bad - column.begin() + 1));
    }
  }
}

namespace {

/// The lower triangular L with L Lᵀ the correlations of all quantities that have some, in their
/// order. A quantity correlates with earlier ones, so that the deviates of those before it do not
/// depend on its law.
struct CorrelationFactor {
  std::vector<std::size_t> quantities;
  std::vector<std::vector<double>> rows;
  /// The first quantity with which the correlations are no longer positive definite.
  std::optional<std::size_t> not_definite = {};
};

double product_of(std::span<const double> first, std::span<const double> second) {
  return std::inner_product(first.begin(), first.end(), second.begin(), 0.0);
}

CorrelationFactor correlation_factor(const LawSet& set) {
  std::set<std::size_t> involved;
  for (std::size_t i = 0; i < set.laws.size(); ++i) {
    if (set.laws[i].law != Law::correlated) continue;
    involved.insert(i);
    for (const std::string& name : set.laws[i].with) involved.insert(set.index_of(name));
  }
  CorrelationFactor factor{.quantities = {involved.begin(), involved.end()}, .rows = {}};
  for (const std::size_t quantity : factor.quantities) {
    const Dispersion& law = set.laws[quantity];
    std::vector<double> row;
    for (const std::vector<double>& before : factor.rows) {
      const std::string& name = set.names[factor.quantities[row.size()]];
      const auto found = std::ranges::find(law.with, name);
      const bool is_given = law.law == Law::correlated && found != law.with.end();
      const double correlation =
          is_given ? law.correlations[static_cast<std::size_t>(found - law.with.begin())] : 0.0;
      row.push_back((correlation - product_of(row, before)) / before.back());
    }
    const double rest = 1.0 - product_of(row, row);
    constexpr double rest_min = 1e-9;  // Below it nothing but rounding may be left.
    if (!(rest > rest_min)) {
      factor.not_definite = quantity;
      return factor;
    }
    row.push_back(std::sqrt(rest));
    factor.rows.push_back(std::move(row));
  }
  return factor;
}

Stratum stratum_in(const SamplingDesign& design, std::size_t quantity, std::uint64_t seed,
                   RunIndex run, std::uint32_t draw) {
  return draw == 0 ? stratum_of(design, quantity, seed, run) : Stratum{};
}

/// Replaces the values of quantities with the law `correlated`.
void correlate(const LawSet& set, std::uint64_t seed, RunIndex run, std::uint32_t draw,
               const SamplingDesign& design, std::span<double> values) {
  const CorrelationFactor factor = correlation_factor(set);
  std::vector<double> deviates;
  for (std::size_t i = 0; i < factor.rows.size(); ++i) {
    const std::size_t quantity = factor.quantities[i];
    const Dispersion& law = set.laws[quantity];
    deviates.push_back(draw_deviate(set.names[quantity], seed, run, draw,
                                    stratum_in(design, quantity, seed, run, draw)));
    if (law.law != Law::correlated) continue;
    values[quantity] = law.mean + law.standard_deviation * product_of(factor.rows[i], deviates);
  }
}

/// Computes values of the law `derived`, each after those that it needs.
class Derivation {
 public:
  Derivation(const LawSet& set, std::span<double> values)
      : set_(set), values_(values), is_known_(values.size()) {}

  double value_of(std::size_t quantity) {
    if (set_.laws[quantity].law != Law::derived || is_known_[quantity]) return values_[quantity];
    values_[quantity] = evaluate_expression(
        set_.laws[quantity].expression,
        [this](std::string_view name) { return value_of(set_.index_of(name)); });
    is_known_[quantity] = true;
    return values_[quantity];
  }

 private:
  const LawSet& set_;
  std::span<double> values_;
  std::vector<bool> is_known_;
};

/// Follows the names in expressions, each quantity once.
class ExpressionCheck {
 public:
  explicit ExpressionCheck(const LawSet& set) : set_(set), states_(set.laws.size()) {}

  void run(std::size_t quantity) {
    if (set_.laws[quantity].law != Law::derived || states_[quantity] == State::sound) return;
    states_[quantity] = State::open;
    const auto refuse = [&](const std::string& rule) {
      throw ConfigError(set_.path_of(quantity) + ".expression",
                        fmt::format("\"{}\"", set_.laws[quantity].expression), rule);
    };
    const auto follow = [&](std::string_view name) {
      const std::size_t next = set_.index_of(name);
      if (next == set_.laws.size()) {
        refuse(
            fmt::format("{} is no drawn quantity; the functions are sqrt(x) and pow(x, n)", name));
      }
      if (states_[next] == State::open) refuse(fmt::format("{} depends on it in turn", name));
      if (depth_ == chain_size_max) {
        refuse(fmt::format("more than {} need one another in a row", chain_size_max));
      }
      ++depth_;
      run(next);
      --depth_;
      return 1.0;
    };
    try {
      (void)evaluate_expression(set_.laws[quantity].expression, follow);
    } catch (const InvalidArgument& error) {
      refuse(error.what());
    }
    states_[quantity] = State::sound;
  }

 private:
  enum class State : std::uint8_t { unknown, open, sound };
  // Each of them takes some of the stack where a value is drawn.
  static constexpr int chain_size_max = 64;

  const LawSet& set_;
  std::vector<State> states_;
  int depth_ = 0;
};

void check_partners(const LawSet& set, std::size_t quantity) {
  const Dispersion& law = set.laws[quantity];
  const auto refuse = [&](std::string_view name, std::string_view rule) {
    throw ConfigError(set.path_of(quantity) + ".with", fmt::format("\"{}\"", name), rule);
  };
  std::set<std::string> seen;
  for (const std::string& name : law.with) {
    const std::size_t other = set.index_of(name);
    if (other == set.laws.size()) refuse(name, "is no drawn quantity");
    if (other >= quantity) refuse(name, "must come before it in the order of drawn quantities");
    if (!seen.insert(name).second) refuse(name, "is there twice");
    const Law of_other = set.laws[other].law;
    if (of_other != Law::normal && of_other != Law::correlated) {
      refuse(name, "must have the law normal or correlated");
    }
  }
}

}  // namespace

void check_laws(const LawSet& set) {
  for (std::size_t i = 0; i < set.laws.size(); ++i) set.laws[i].validate(set.path_of(i));
  ExpressionCheck expressions(set);
  for (std::size_t i = 0; i < set.laws.size(); ++i) {
    expressions.run(i);
    if (set.laws[i].law == Law::correlated) check_partners(set, i);
  }
  if (const auto quantity = correlation_factor(set).not_definite) {
    throw ConfigError(
        set.path_of(*quantity) + ".correlations",
        fmt::format("[{}]", fmt::join(set.laws[*quantity].correlations, ", ")),
        "with those before it, the correlations must be positive definite; `covariances` give "
        "them over both standard deviations");
  }
}

void check_design(const LawSet& set, const Campaign& campaign) {
  const SamplingDesign design = campaign.design;
  const auto refuse = [&](std::string_view reason) {
    throw ConfigError("campaign.design", fmt::format("\"{}\"", name_of(design.kind)), reason);
  };
  design.validate(campaign.num_runs);
  if (design.kind == DesignKind::random) return;
  if (campaign.realisations > 1) {
    refuse("must be \"random\" with campaign.realisations, which needs independent instruments");
  }
  if (set.laws.size() > sobol_dimensions) {
    refuse(fmt::format("must be \"random\" with more than {} drawn quantities", sobol_dimensions));
  }
  for (const std::size_t element : table_elements(set.laws)) {
    if (set.laws[element].is_independent) continue;
    refuse(fmt::format("must be \"random\" with a table that is not declared independent, {}",
                       set.path_of(element)));
  }
}

void check_independence(const LawSet& set, const Campaign& campaign) {
  const std::vector<std::size_t> drawn = table_elements(set.laws);
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    const Dispersion& law = set.laws[drawn[i]];
    if (!law.is_independent) continue;
    const std::vector<double>& column = campaign.table_columns[i];
    std::vector<double> rows;
    for (std::size_t run = 0; run < column.size(); run += campaign.realisations) {
      rows.push_back(column[run]);
    }
    const std::string why = why_dependent(rows);
    if (why.empty()) continue;
    throw ConfigError(
        set.path_of(drawn[i]) + ".independent", "true",
        fmt::format("column \"{}\" {}; leave the key out, or draw each row anew", law.column, why));
  }
}

std::optional<DefinitionDifference> table_difference(const DrawnCampaign& first,
                                                     const DrawnCampaign& second,
                                                     std::size_t quantity) {
  const auto column_of = [quantity](const DrawnCampaign& of) {
    const std::vector<std::size_t> elements = table_elements(of.set.laws);
    const auto place = std::ranges::find(elements, quantity) - elements.begin();
    const std::vector<double>& column = of.campaign.table_columns[static_cast<std::size_t>(place)];
    return std::span(column).first(std::min<std::size_t>(column.size(), of.campaign.num_runs));
  };
  const std::span<const double> here = column_of(first), there = column_of(second);
  for (std::size_t run = 0; run < std::min(here.size(), there.size()); ++run) {
    if (std::bit_cast<std::uint64_t>(here[run]) == std::bit_cast<std::uint64_t>(there[run])) {
      continue;
    }
    return DefinitionDifference{fmt::format("{} of run {}", first.set.path_of(quantity), run),
                                fmt::format("{}", here[run]), fmt::format("{}", there[run])};
  }
  return std::nullopt;
}

void draw_values(const LawSet& set, std::uint64_t seed, RunIndex run, std::uint32_t draw,
                 std::span<const double> table_values, const SamplingDesign& design,
                 std::span<double> values) {
  std::size_t next_table_value = 0;
  bool is_related = false;
  for (std::size_t i = 0; i < set.laws.size(); ++i) {
    const Law law = set.laws[i].law;
    if (law == Law::derived || law == Law::correlated) {
      is_related = true;
      continue;
    }
    const bool is_of_table = law == Law::table;
    PROOFMASS_EXPECT(!is_of_table || next_table_value < table_values.size());
    const double table_value = is_of_table ? table_values[next_table_value++] : 0.0;
    values[i] = draw_value(set.laws[i], set.names[i], seed, run, draw, table_value,
                           stratum_in(design, i, seed, run, draw));
  }
  if (!is_related) return;
  correlate(set, seed, run, draw, design, values);
  Derivation derivation(set, values);
  for (std::size_t i = 0; i < set.laws.size(); ++i) (void)derivation.value_of(i);
}

}  // namespace proofmass
