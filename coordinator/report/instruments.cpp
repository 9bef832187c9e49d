#include "coordinator/report/instruments.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <utility>

#include "coordinator/report/report_tables.hpp"
#include "coordinator/report/standard_errors.hpp"
#include "core/error.hpp"
#include "core/model.hpp"

namespace proofmass::coordinator {
namespace {

/// Position among a result's standard errors; empty if the quantity has none.
std::optional<std::size_t> standard_error_of(std::size_t quantity) {
  const std::vector<proofmass::Quantity>& all = model().results().quantities;
  if (!all[quantity].has_standard_error) return std::nullopt;
  std::size_t position = 0;
  for (std::size_t i = 0; i < quantity; ++i) {
    if (all[i].has_standard_error) ++position;
  }
  return position;
}

/// Mean over the runs of an instrument.
template <typename ValueOf>
double mean_over(std::span<const RunResult> runs, const ValueOf& value_of) {
  double sum = 0.0;
  for (const RunResult& run : runs) sum += value_of(run);
  return sum / static_cast<double>(runs.size());
}

GroupedShare share_of(const MomentSums& sums, std::uint64_t realisations) {
  const Moments shares = sums.moments();
  return {shares.mean, grouped_probability_interval(shares, realisations, default_confidence)};
}

}  // namespace

RunningInstruments::RunningInstruments(std::vector<double> objectives, std::uint64_t realisations)
    : objectives_(std::move(objectives)), realisations_(realisations) {
  PROOFMASS_EXPECT(realisations_ > 1);
  counts_.realisations = realisations_;
  counts_.temporal = 1.0;
}

void RunningInstruments::add(const RunResult& result) {
  const auto instrument_of = [&](const RunResult& run) { return run.run.value / realisations_; };
  if (!runs_.empty() && instrument_of(runs_.front()) != instrument_of(result)) {
    ++counts_.num_incomplete;
    runs_.clear();
  }
  runs_.push_back(result);
  if (runs_.size() < realisations_) return;
  finish_instrument();
  runs_.clear();
}

std::uint64_t RunningInstruments::num_within(const std::vector<RunResult>& runs) const {
  std::uint64_t count = 0;
  for (const RunResult& run : runs) {
    bool is_within = run.is_completed();
    for (std::size_t i = 0; is_within && i < objectives_.size(); ++i) {
      is_within = std::abs(run.error(i)) <= objectives_[i];
    }
    if (is_within) ++count;
  }
  return count;
}

void RunningInstruments::finish_instrument() {
  ++counts_.num_instruments;
  const double share = static_cast<double>(num_within(runs_)) / static_cast<double>(realisations_);
  within_.add(share);
  if (share == 1.0) ++num_within_always_;
  if (share < counts_.temporal) {
    counts_.temporal = share;
    counts_.temporal_instrument = runs_.front().run.value / realisations_;
  }
  if (std::ranges::all_of(runs_, &RunResult::is_completed)) return add_quantities();
  ++counts_.num_not_estimated;
}

void RunningInstruments::add_quantities() {
  const double correction =
      std::sqrt(static_cast<double>(realisations_) / static_cast<double>(realisations_ - 1));
  for (std::size_t i = 0; i < objectives_.size(); ++i) {
    std::vector<double> errors;
    for (const RunResult& run : runs_) errors.push_back(run.error(i));
    const double magnitude =
        mean_over(runs_, [i](const RunResult& run) { return std::abs(run.error(i)); });
    if (i == quantities_.size()) {
      const MomentSums shares(0.5);
      quantities_.push_back({.errors = GroupedValues(realisations_),
                             .magnitudes = MomentSums(magnitude),
                             .beyond = shares,
                             .covered = shares,
                             .covered_within = shares});
    }
    Quantity& quantity = quantities_[i];
    quantity.errors.add(errors);
    quantity.magnitudes.add(magnitude);
    quantity.beyond.add(mean_over(
        runs_, [&](const RunResult& run) { return std::abs(run.error(i)) > objectives_[i]; }));
    const std::optional<std::size_t> position = standard_error_of(i);
    if (!position || runs_.front().standard_error.empty()) continue;
    const double mean = mean_over(runs_, [i](const RunResult& run) { return run.error(i); });
    const auto sigma = [&](const RunResult& run) { return run.standard_error.at(*position); };
    quantity.has_standard_errors = true;
    quantity.squared_standard_errors +=
        mean_over(runs_, [&](const RunResult& run) { return sigma(run) * sigma(run); });
    quantity.covered.add(mean_over(runs_, [&](const RunResult& run) {
      return std::abs(run.error(i)) < normal_95 * sigma(run);
    }));
    quantity.covered_within.add(mean_over(runs_, [&](const RunResult& run) {
      return correction * std::abs(run.error(i) - mean) < normal_95 * sigma(run);
    }));
  }
}

InstrumentStatistics RunningInstruments::statistics() const {
  InstrumentStatistics statistics = counts_;
  if (!runs_.empty()) ++statistics.num_incomplete;
  if (statistics.num_instruments == 0) return statistics;
  const auto instruments = static_cast<double>(statistics.num_instruments);
  const auto always = static_cast<double>(num_within_always_);
  statistics.mixed = share_of(within_, realisations_);
  statistics.ensemble = {always / instruments,
                         probability_interval(always, instruments, default_confidence)};
  for (const Quantity& quantity : quantities_) {
    const Moments magnitudes = quantity.magnitudes.moments();
    InstrumentQuantity of{.error = quantity.errors.analysis(default_confidence),
                          .mean_magnitude = magnitudes.mean,
                          .magnitude_interval = mean_interval(magnitudes, default_confidence),
                          .beyond = share_of(quantity.beyond, realisations_),
                          .standard_errors = {}};
    const double squares =
        quantity.squared_standard_errors / static_cast<double>(of.error.num_groups);
    if (quantity.has_standard_errors && squares > 0.0) {
      of.standard_errors = {.within_ratio = of.error.within_mean_square / squares,
                            .covered = share_of(quantity.covered, realisations_),
                            .covered_within = share_of(quantity.covered_within, realisations_)};
    }
    statistics.quantities.push_back(std::move(of));
  }
  return statistics;
}

namespace {

void add_ends(const std::optional<Interval>& interval, double scale, Row& row) {
  for (const double Interval::*end : {&Interval::lower, &Interval::upper}) {
    row.push_back(interval ? figure_cell((*interval).*end, scale) : no_figure());
  }
}

std::string share_text(const GroupedShare& of) {
  return fmt::format("{:.3g} % ({:.3g} to {:.3g} %)", 100.0 * of.share, 100.0 * of.interval.lower,
                     100.0 * of.interval.upper);
}

std::string count_text(const InstrumentStatistics& statistics) {
  std::string text = fmt::format("{} instruments with {} realisations of the noise each",
                                 statistics.num_instruments, statistics.realisations);
  if (statistics.num_incomplete > 0) {
    text += fmt::format("; {} more left out, being incomplete", statistics.num_incomplete);
  }
  if (statistics.num_not_estimated > 0) {
    text += fmt::format("; {} have a run without an estimate and count for shares of runs alone",
                        statistics.num_not_estimated);
  }
  return text;
}

}  // namespace

Table variance_table(const InstrumentStatistics& statistics) {
  if (statistics.quantities.empty()) return {};
  constexpr const char* mean = "mean of |error|";
  constexpr const char* deviation = "std of the error";
  constexpr const char* noise = "noise, % of variance";
  Table table{
      .id = "variance-table",
      .caption = "Variance between instruments and within, 95 % intervals",
      .columns = {{"parameter", true, 11},
                  {"unit", true, 9},
                  {"mean", false, 8, mean},
                  {"from", false, 8, mean},
                  {"to", false, 8, mean},
                  {"between", false, 9, deviation, true},
                  {"within", false, 9, deviation},
                  {"share", false, 6, noise, true},
                  {"from", false, 6, noise},
                  {"to", false, 6, noise}},
      .notes = {count_text(statistics), "the unit of all intervals is the instrument",
                "that of the share holds for normal errors that scatter alike in every instrument",
                "noise: no choice of the instruments saves more than the inverse of its share"}};
  for (std::size_t i = 0; i < statistics.quantities.size(); ++i) {
    const proofmass::Quantity& quantity = model().results().quantities[i];
    const InstrumentQuantity& of = statistics.quantities[i];
    const double scale = quantity.display_scale;
    Row row{quantity.symbol, unit_cell(quantity), figure_cell(of.mean_magnitude, scale)};
    add_ends(of.magnitude_interval, scale, row);
    row.push_back(figure_cell(of.error.between_deviation, scale));
    row.push_back(figure_cell(of.error.within_deviation, scale));
    row.push_back(figure_cell(of.error.within_share, 0.01));
    add_ends(of.error.within_share_interval, 0.01, row);
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table instrument_table(const InstrumentStatistics& statistics) {
  if (statistics.quantities.empty()) return {};
  constexpr const char* beyond = "beyond, %";
  constexpr const char* covered = "in 1.96 σ, %";
  constexpr const char* within = "within, in 1.96 σ, %";
  Table table{
      .id = "instrument-table",
      .caption = "Bias, runs beyond the objective and standard errors by instruments, 95 %",
      .columns = {{"parameter", true, 10},
                  {"from", false, 9, "bias"},
                  {"to", false, 10, "bias"},
                  {"from", false, 7, beyond, true},
                  {"to", false, 7, beyond},
                  {"from", false, 7, covered, true},
                  {"to", false, 7, covered},
                  {"s²/σ²", false, 8, within, true},
                  {"from", false, 7, within},
                  {"to", false, 7, within}},
      .notes = {
          "within: about the mean of each instrument; s² is the variance there",
          fmt::format("all objectives (mixed): {} of all runs", share_text(statistics.mixed)),
          fmt::format("all objectives (ensemble): {} of all instruments, in all {} realisations",
                      share_text(statistics.ensemble), statistics.realisations),
          fmt::format("all objectives (temporal): {:.0f} of {} realisations or more of every "
                      "instrument, fewest of instrument {}",
                      statistics.temporal * static_cast<double>(statistics.realisations),
                      statistics.realisations, statistics.temporal_instrument)}};
  for (std::size_t i = 0; i < statistics.quantities.size(); ++i) {
    const proofmass::Quantity& quantity = model().results().quantities[i];
    const InstrumentQuantity& of = statistics.quantities[i];
    Row row{quantity.symbol};
    add_ends(of.error.mean_interval, quantity.display_scale, row);
    add_ends(of.beyond.interval, 0.01, row);
    const auto& sigma = of.standard_errors;
    add_ends(sigma ? std::optional(sigma->covered.interval) : std::nullopt, 0.01, row);
    row.push_back(sigma ? figure_cell(sigma->within_ratio) : no_figure());
    add_ends(sigma ? std::optional(sigma->covered_within.interval) : std::nullopt, 0.01, row);
    table.rows.push_back(std::move(row));
  }
  return table;
}

namespace {

using Json = nlohmann::ordered_json;

Json ends_of(const std::optional<Interval>& interval) {
  if (!interval) return nullptr;
  return Json::array({interval->lower, interval->upper});
}

Json json_of(const GroupedShare& of) {
  return {{"share", of.share}, {"interval", ends_of(of.interval)}};
}

Json json_of(const InstrumentQuantity& of) {
  Json json{{"mean", of.mean_magnitude},
            {"mean_interval", ends_of(of.magnitude_interval)},
            {"bias", of.error.mean},
            {"bias_interval", ends_of(of.error.mean_interval)},
            {"between_mean_square", of.error.between_mean_square},
            {"within_mean_square", of.error.within_mean_square},
            {"p_value", of.error.p_value},
            {"between_standard_deviation", of.error.between_deviation},
            {"between_interval", ends_of(of.error.between_interval)},
            {"within_standard_deviation", of.error.within_deviation},
            {"within_interval", ends_of(of.error.within_interval)},
            {"noise_share", of.error.within_share},
            {"noise_share_interval", ends_of(of.error.within_share_interval)},
            {"beyond", json_of(of.beyond)},
            {"standard_errors", nullptr}};
  if (of.standard_errors) {
    json["standard_errors"] = {{"within_ratio", of.standard_errors->within_ratio},
                               {"covered", json_of(of.standard_errors->covered)},
                               {"covered_within", json_of(of.standard_errors->covered_within)}};
  }
  return json;
}

}  // namespace

nlohmann::ordered_json json_of(const InstrumentStatistics& statistics) {
  Json json{{"realisations", statistics.realisations},
            {"num_instruments", statistics.num_instruments},
            {"num_incomplete", statistics.num_incomplete},
            {"num_not_estimated", statistics.num_not_estimated},
            {"all_objectives",
             {{"mixed", json_of(statistics.mixed)},
              {"ensemble", json_of(statistics.ensemble)},
              {"temporal", statistics.temporal},
              {"temporal_instrument", statistics.temporal_instrument}}},
            {"parameters", Json::array()}};
  for (std::size_t i = 0; i < statistics.quantities.size(); ++i) {
    Json row{{"parameter", model().results().quantities[i].name}};
    row.update(json_of(statistics.quantities[i]));
    json["parameters"].push_back(std::move(row));
  }
  return json;
}

}  // namespace proofmass::coordinator
