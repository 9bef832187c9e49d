#include <fmt/format.h>

#include "core/statistics/comparison.hpp"
#include "core/statistics/correlation.hpp"
#include "core/statistics/distribution.hpp"
#include "core/statistics/error_change.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/moments.hpp"
#include "core/statistics/order.hpp"
#include "core/statistics/requirement.hpp"
#include "core/statistics/sensitivity.hpp"
#include "tests/core/statistics/columns.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr double confidence = 0.9;

/// A column of doubles as the oracle reads it: hexadecimal, without any rounding.
std::string text_of(const std::vector<double>& values) {
  std::string text;
  for (const double value : values) text += fmt::format(" {:a}", value);
  return text;
}

std::vector<double> ends(const std::optional<Interval>& interval) {
  if (!interval) return {};
  return {interval->lower, interval->upper};
}

/// Everything that the oracle is asked to confirm: named columns, then lines
/// `function argument... : value...`.
class Questions {
 public:
  void add_column(const std::string& name, std::vector<double> values) {
    text_ += "column " + name + text_of(values) + "\n";
    columns_[name] = std::move(values);
  }
  void ask(const std::string& question, const std::vector<double>& values) {
    text_ += question + " :" + text_of(values) + "\n";
  }
  [[nodiscard]] const std::map<std::string, std::vector<double>>& columns() const {
    return columns_;
  }
  [[nodiscard]] const std::vector<double>& column(const std::string& name) const {
    return columns_.at(name);
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::map<std::string, std::vector<double>> columns_;
  std::string text_;
};

std::vector<double> changed(std::vector<double> values, double offset, double scale) {
  for (double& value : values) value = offset + scale * value;
  return values;
}

std::vector<double> rounded(std::vector<double> values) {
  for (double& value : values) value = std::round(2.0 * value);
  return values;
}

void add_columns(Questions& questions) {
  const auto normal = [](std::size_t n, std::uint32_t column) {
    return test::normal_column(n, {.seed = 7, .column = column});
  };
  questions.add_column("normal", normal(400, 0));
  questions.add_column("related", changed(normal(400, 0), 0.2, 0.7));
  std::vector<double> related = normal(400, 1);
  for (std::size_t i = 0; i < related.size(); ++i) related[i] += 0.3 + normal(400, 0)[i];
  questions.add_column("noisy", related);
  questions.add_column("few", normal(12, 2));
  questions.add_column("others", changed(normal(31, 3), 0.5, 2.0));
  questions.add_column("equal_values", rounded(normal(400, 4)));
  questions.add_column("magnitudes", test::half_normal_column(900, {.seed = 7, .column = 5}));
  questions.add_column("offset", changed(normal(20'000, 6), 1e8, 2e-4));
  questions.add_column("offset_too", changed(normal(20'000, 7), -1e8, 2e-4));
  questions.add_column("tiny", changed(normal(5000, 8), 1e-13, 1e-12));
}

void ask_about_single_columns(Questions& questions) {
  for (const auto& [name, values] : questions.columns()) {
    const Moments about = moments(values);
    const std::vector<double> ascending = sorted(values);
    questions.ask("moments " + name, {about.mean, about.standard_deviation, about.rms,
                                      about.skewness, about.excess_kurtosis});
    questions.ask("ranks " + name, average_ranks(values));
    questions.ask("mean_interval " + name + " 0.9", ends(mean_interval(about, confidence)));
    questions.ask("deviation_interval " + name + " 0.9",
                  ends(deviation_interval(about, confidence)));
    questions.ask("bootstrap_deviation_interval " + name + " 0.9",
                  ends(bootstrap_deviation_interval(values, confidence)));
    for (const double level : {0.1, 0.5, 0.95, 0.99}) {
      questions.ask(fmt::format("percentile {} {}", name, level), {percentile(ascending, level)});
      questions.ask(fmt::format("percentile_interval {} {} 0.9", name, level),
                    ends(percentile_interval(ascending, level, confidence)));
    }
  }
}

void ask_about_dependence(Questions& questions, const std::string& x, const std::string& y) {
  const std::vector<double>& first = questions.column(x);
  const std::vector<double>& second = questions.column(y);
  const std::string names = fmt::format(" {} {}", x, y);
  const auto index = test::first_order_index(first, second, confidence);
  questions.ask("linear_correlation" + names, {linear_correlation(first, second).value()});
  questions.ask("rank_correlation" + names, {rank_correlation(first, second).value()});
  questions.ask("first_order_index" + names + " 0.9",
                {index->index, index->standard_error, index->interval.lower, index->interval.upper,
                 index->p_value});
}

void ask_about_pair(Questions& questions, const std::string& a, const std::string& b) {
  const auto differences = test::differences_of(questions.column(a), questions.column(b));
  questions.ask(fmt::format("rank_test {} {}", a, b), {rank_test_p_value(differences)});
}

void ask_about_campaigns(Questions& questions, const std::string& a, const std::string& b) {
  const UnpairedComparison found =
      compare_unpaired(questions.column(a), questions.column(b), confidence);
  questions.ask(fmt::format("compare_unpaired {} {} 0.9", a, b),
                {found.mean_difference, found.interval->lower, found.interval->upper,
                 found.mean_p_value, found.distance, found.law_p_value});
}

void ask_about_changes(Questions& questions, const std::string& a, const std::string& b) {
  const std::vector<double>& first = questions.column(a);
  const std::vector<double>& second = questions.column(b);
  const ChangePValues found = compare_errors(first, second);
  questions.ask(fmt::format("compare_errors {} {}", a, b),
                {tail_limit(first, second), found.location, found.scale, found.tail});
}

void ask_about_two_columns(Questions& questions) {
  ask_about_dependence(questions, "normal", "noisy");
  ask_about_dependence(questions, "equal_values", "noisy");
  ask_about_dependence(questions, "offset", "offset_too");
  ask_about_pair(questions, "normal", "noisy");
  ask_about_pair(questions, "normal", "equal_values");
  ask_about_pair(questions, "equal_values", "related");
  questions.add_column("few_again", changed(questions.column("few"), 0.1, 1.4));
  ask_about_pair(questions, "few", "few_again");
  ask_about_campaigns(questions, "few", "others");
  ask_about_campaigns(questions, "normal", "noisy");
  ask_about_campaigns(questions, "magnitudes", "equal_values");
  ask_about_changes(questions, "normal", "noisy");
  ask_about_changes(questions, "magnitudes", "equal_values");
  const std::vector<double> p_values{0.03, 0.002, 0.3, 0.04, 0.002, 0.9, 0.01, 0.5, 0.06, 0.2};
  questions.add_column("p_values", p_values);
  questions.ask("holm_adjusted p_values", holm_adjusted(p_values));
}

void ask_about_laws(Questions& questions) {
  for (const double p : {1e-6, 0.025, 0.4, 0.95, 0.9995}) {
    for (const double degrees : {1.0, 2.5, 19.0, 399.0, 1e6}) {
      questions.ask(fmt::format("student_quantile {} {}", p, degrees),
                    {student_quantile(p, degrees)});
    }
    questions.ask(fmt::format("beta_quantile {} 3.5 40", p), {beta_quantile(p, 3.5, 40.0)});
    questions.ask(fmt::format("beta_quantile {} 900 20000", p), {beta_quantile(p, 900.0, 2e4)});
  }
  for (const double x : {-9.0, -1.5, 0.0, 0.3, 2.0, 7.0}) {
    questions.ask(fmt::format("normal_cumulative {}", x), {normal_cumulative(x)});
    questions.ask(fmt::format("student_two_sided {} 7", x), {student_two_sided(x, 7.0)});
  }
  for (const double x : {0.2, 0.5, 0.99, 1.0, 1.7, 6.0}) {
    questions.ask(fmt::format("kolmogorov_upper {}", x), {kolmogorov_upper(x)});
  }
  for (const double k : {0.0, 3.0, 10.0, 31.0}) {
    questions.ask(fmt::format("binomial {} 1000 0.01", k),
                  {binomial_at_most(k, 1000.0, 0.01), binomial_at_least(k, 1000.0, 0.01)});
  }
}

// Tails from one run to a billion, around the middle of the law and six deviations out.
void ask_about_special_functions(Questions& questions) {
  for (const double a : {0.5, 7.0, 300.0, 1e4, 3e8}) {
    for (const double b : {0.5, 40.0, 9000.0, 1e9}) {
      const double mean = a / (a + b);
      const double deviation = std::sqrt(mean * (1.0 - mean) / (a + b + 1.0));
      for (const double steps : {-6.0, -1.0, 0.0, 1.5, 6.0}) {
        const double x = mean + steps * deviation;
        if (x <= 0.0 || x >= 1.0) continue;
        questions.ask(fmt::format("regularised_beta {} {} {:a}", a, b, x),
                      {beta_at_most(x, a, b), beta_above(x, a, b)});
      }
    }
    for (const double x : {0.5 * a, a, 1.01 * a, a + 6.0 * std::sqrt(a)}) {
      questions.ask(fmt::format("regularised_gamma {} {:a}", a, x),
                    {chi_square_at_most(2.0 * x, 2.0 * a), chi_square_above(2.0 * x, 2.0 * a)});
    }
  }
}

// No hits, some, all, and a hundred hits in a billion runs; both bounds at 0 and 1 are exact.
void ask_about_probabilities(Questions& questions) {
  for (const double shown_with : {0.5, 0.9, 0.95, 0.999}) {
    for (const double num_runs : {1.0, 17.0, 100.0, 30'000.0, 1e9}) {
      for (const double hits : {0.0, 1.0, 2.0, 16.0, 100.0, num_runs - 1.0, num_runs}) {
        if (hits > num_runs) continue;
        const std::string arguments = fmt::format(" {:.0f} {:.0f} {}", hits, num_runs, shown_with);
        questions.ask("probability_interval" + arguments,
                      ends(probability_interval(hits, num_runs, shown_with)));
        questions.ask("probability_bounds" + arguments,
                      ends(probability_bounds(hits, num_runs, shown_with)));
      }
    }
  }
}

void ask_about_tolerances(Questions& questions) {
  for (const double coverage : {0.5, 0.9, 0.95, 0.99}) {
    for (const double shown_with : {0.6, 0.9, 0.95, 0.999}) {
      const std::vector<double>& values = questions.column("magnitudes");
      const Tolerance tolerance{coverage, shown_with};
      const auto bound = wilks_upper(values, tolerance);
      if (!bound) continue;
      questions.ask(fmt::format("wilks_upper magnitudes {} {}", coverage, shown_with),
                    {*bound, static_cast<double>(wilks_order(tolerance, values.size()))});
    }
  }
}

// numpy, scipy and mpmath in a process of their own; its output names every number that differs.
TEST(StatisticsOracle, ConfirmsEveryStatistic) {
  Questions questions;
  add_columns(questions);
  ask_about_single_columns(questions);
  ask_about_two_columns(questions);
  ask_about_laws(questions);
  ask_about_special_functions(questions);
  ask_about_probabilities(questions);
  ask_about_tolerances(questions);

  const std::string path = testing::TempDir() + "proofmass_statistics_questions.txt";
  const std::string answer_path = path + ".answer";
  std::ofstream(path) << questions.text();
  const std::string command =
      fmt::format("/usr/bin/python3 '{}' '{}' > '{}' 2>&1", PROOFMASS_ORACLE, path, answer_path);
  const int status = std::system(command.c_str());
  std::stringstream answer;
  answer << std::ifstream(answer_path).rdbuf();
  EXPECT_EQ(status, 0) << answer.str();
  EXPECT_NE(answer.str().find("all confirmed"), std::string::npos) << answer.str();
}

}  // namespace
}  // namespace proofmass
