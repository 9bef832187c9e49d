#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "coordinator/report/json.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/report/requirements.hpp"
#include "coordinator/report/standard_errors.hpp"
#include "coordinator/table/table.hpp"

namespace proofmass::coordinator {
namespace {

GroupedShare share_of(const GroupedHits& hits) {
  return {hits.share(), hits.interval(default_confidence)};
}

}  // namespace

RunningInstruments::RunningInstruments(const ResultSchema& schema, std::vector<double> objectives,
                                       std::uint64_t realisations)
    : objectives_(std::move(objectives)), groups_(realisations), within_(realisations) {
  counts_.realisations = realisations;
  const GroupedHits hits(realisations);
  quantities_.assign(objectives_.size(), {.errors = GroupedValues(realisations),
                                          .beyond = hits,
                                          .covered = hits,
                                          .covered_within = hits});
  std::size_t num_standard_errors = 0;
  for (std::size_t i = 0; i < quantities_.size(); ++i) {
    if (schema.quantities[i].has_standard_error) quantities_[i].position = num_standard_errors++;
  }
}

void RunningInstruments::add(const RunResult& run) {
  const Runs runs = groups_.add(run);
  if (runs.empty()) return;
  add_objectives(runs);
  for (std::size_t i = 0; i < objectives_.size(); ++i) {
    const auto is_miss = [&](const RunResult& of) { return is_beyond(of, i, objectives_[i]); };
    quantities_[i].beyond.add(count_of(runs, is_miss));
  }
  if (!std::ranges::all_of(runs, &RunResult::is_completed)) {
    ++counts_.num_not_estimated;
    return;
  }
  for (std::size_t i = 0; i < objectives_.size(); ++i) add_values(runs, i);
}

void RunningInstruments::add_objectives(Runs runs) {
  const std::uint64_t num_within = count_of(runs, [&](const RunResult& run) {
    for (std::size_t i = 0; i < objectives_.size(); ++i) {
      if (is_beyond(run, i, objectives_[i])) return false;
    }
    return true;
  });
  within_.add(num_within);
  if (num_within == runs.size()) ++num_within_always_;
  if (counts_.num_instruments == 0 || num_within < counts_.temporal) {
    counts_.temporal = num_within;
    counts_.num_temporal = 0;
    counts_.temporal_instrument = runs.front().run.value / runs.size();
  }
  if (num_within == counts_.temporal) ++counts_.num_temporal;
  ++counts_.num_instruments;
}

void RunningInstruments::add_values(Runs runs, std::size_t i) {
  Quantity& quantity = quantities_[i];
  std::vector<double> errors;
  CompensatedSum sum, magnitudes;
  for (const RunResult& run : runs) {
    errors.push_back(run.error(i));
    sum.add(errors.back());
    magnitudes.add(std::abs(errors.back()));
  }
  const auto count = static_cast<double>(runs.size());
  quantity.errors.add(errors);
  quantity.magnitudes.add(magnitudes.value() / count);
  if (!quantity.position || runs.front().standard_error.empty()) return;
  have_standard_errors_ = true;
  const auto sigma = [&](const RunResult& run) { return run.standard_error[*quantity.position]; };
  for (const RunResult& run : runs) quantity.squared_standard_errors += sigma(run) * sigma(run);
  const auto add = [&](GroupedHits& hits, double centre, double factor) {
    hits.add(count_of(runs, [&](const RunResult& run) {
      return std::abs((run.error(i) - centre) * factor) < normal_95 * sigma(run);
    }));
  };
  add(quantity.covered, 0.0, 1.0);
  add(quantity.covered_within, sum.value() / count, std::sqrt(count / (count - 1.0)));
}

InstrumentQuantity RunningInstruments::statistics_of(std::size_t i) const {
  const Quantity& quantity = quantities_[i];
  InstrumentQuantity of{.error = quantity.errors.analysis(default_confidence)};
  if (std::isfinite(objectives_[i])) of.beyond = share_of(quantity.beyond);
  if (of.error.num_groups > 0) {
    const Moments magnitudes = quantity.magnitudes.moments();
    of.mean_magnitude = magnitudes.mean;
    of.magnitude_interval = not_negative(mean_interval(magnitudes, default_confidence));
    of.is_too_skewed = is_too_skewed(magnitudes.skewness, magnitudes.count);
  }
  if (!have_standard_errors_ || !quantity.position) return of;
  of.standard_errors = {.within_ratio = {},
                        .covered = share_of(quantity.covered),
                        .covered_within = share_of(quantity.covered_within)};
  if (quantity.squared_standard_errors > 0.0) {
    const auto runs = static_cast<double>(of.error.num_groups * of.error.group_size);
    of.standard_errors->within_ratio =
        of.error.within_mean_square * runs / quantity.squared_standard_errors;
  }
  return of;
}

InstrumentStatistics RunningInstruments::statistics() {
  InstrumentStatistics statistics = counts_;
  statistics.num_incomplete = groups_.incomplete().size();
  if (statistics.num_instruments == 0) return statistics;
  const auto instruments = static_cast<double>(statistics.num_instruments);
  const auto always = static_cast<double>(num_within_always_);
  statistics.mixed = share_of(within_);
  statistics.ensemble = {always / instruments,
                         probability_interval(always, instruments, default_confidence)};
  for (std::size_t i = 0; i < quantities_.size(); ++i) {
    statistics.quantities.push_back(statistics_of(i));
  }
  return statistics;
}

namespace {

std::string share_text(const GroupedShare& of) {
  return fmt::format("{:.3g} % ({})", 100.0 * of.share, interval_percent(of.interval));
}

std::string count_text(const InstrumentStatistics& statistics) {
  std::string text =
      fmt::format("{} with {} realisations of the noise each",
                  counted(statistics.num_instruments, "instrument"), statistics.realisations);
  if (statistics.num_incomplete > 0) {
    text += fmt::format("; {} more left out, as not all of their runs are finished",
                        statistics.num_incomplete);
  }
  return text;
}

std::string temporal_text(const InstrumentStatistics& statistics) {
  const bool is_one = statistics.num_temporal == 1;
  const std::string worst =
      statistics.num_temporal == statistics.num_instruments ? "every instrument"
      : is_one ? fmt::format("the worst instrument, {},", statistics.temporal_instrument)
               : fmt::format("each of the worst {} instruments", statistics.num_temporal);
  return fmt::format("all objectives (temporal): {} meets them in {} of {} realisations", worst,
                     statistics.temporal, statistics.realisations);
}

Table no_instruments(const InstrumentStatistics& statistics) {
  return {.id = "variance-table",
          .caption = "Variance between instruments and within",
          .columns = {{"instruments", true}},
          .rows = {Row{fmt::format("none of which all {} realisations are finished",
                                   statistics.realisations)}}};
}

std::vector<std::string> variance_notes(const ResultSchema& schema,
                                        const InstrumentStatistics& statistics) {
  std::vector<std::string> notes{count_text(statistics)};
  if (statistics.num_not_estimated > 0) {
    notes.push_back(fmt::format("left out: {} with a run that has no estimate",
                                counted(statistics.num_not_estimated, "instrument")));
  }
  notes.emplace_back(
      "from, to: 95 % interval with the instrument as the unit; each holds by itself: of 20, one "
      "misses the true value");
  const std::string skewed =
      symbols_of(schema, [&](std::size_t i) { return statistics.quantities[i].is_too_skewed; });
  if (!skewed.empty()) {
    notes.push_back(fmt::format(
        "mean: too skewed for intervals from {}, which may cover less than 95 %: {}",
        counted(statistics.num_instruments - statistics.num_not_estimated, "instrument"), skewed));
  }
  notes.emplace_back(
      "noise: no choice of the instruments reduces the runs that a bias needs by more than the "
      "inverse of this share");
  if (statistics.num_instruments - statistics.num_not_estimated < num_groups_min) {
    notes.push_back(
        fmt::format("noise: there is no interval from fewer than {} instruments", num_groups_min));
  }
  return notes;
}

}  // namespace

Table variance_table(const ResultSchema& schema, const InstrumentStatistics& statistics) {
  if (statistics.quantities.empty()) return no_instruments(statistics);
  constexpr const char* mean = "mean of |error|";
  constexpr const char* deviation = "std of the error";
  constexpr const char* noise = "noise, %";
  Table table{.id = "variance-table",
              .caption = "Variance between instruments and within",
              .rows = std::vector<Row>(statistics.quantities.size()),
              .notes = variance_notes(schema, statistics)};
  const std::vector<InstrumentQuantity>& all = statistics.quantities;
  const auto scale = [&](std::size_t i) { return schema.quantities[i].display_scale; };
  const auto figure = [&](std::size_t i, double value) {
    return all[i].error.num_groups > 0 ? figure_cell(value, scale(i)) : no_figure();
  };
  add_column(table, {"parameter", true, 10}, [&](auto i) { return schema.quantities[i].symbol; });
  add_column(table, {"unit", true, 9}, [&](auto i) { return unit_cell(schema.quantities[i]); });
  add_column(table, {"mean", false, 7, mean},
             [&](auto i) { return figure(i, all[i].mean_magnitude); });
  add_ends(table, {"from", false, 8, mean}, {"to", false, 8, mean},
           [&](auto i) { return IntervalAndScale(all[i].magnitude_interval, scale(i)); });
  add_column(table, {"between", false, 9, deviation, true},
             [&](auto i) { return figure_cell(all[i].error.between_deviation, scale(i)); });
  add_column(table, {"within", false, 8, deviation},
             [&](auto i) { return figure(i, all[i].error.within_deviation); });
  add_column(table, {"share", false, 7, noise, true},
             [&](auto i) { return figure_cell(all[i].error.within_share, percent_scale); });
  add_ends(table, {"from", false, 6, noise}, {"to", false, 6, noise}, [&](auto i) {
    return IntervalAndScale(all[i].error.within_share_interval, percent_scale);
  });
  return table;
}

Table instrument_table(const ResultSchema& schema, const InstrumentStatistics& statistics) {
  if (statistics.quantities.empty()) return {};
  constexpr const char* beyond = "beyond, %";
  constexpr const char* covered = "in 1.96 σ, %";
  constexpr const char* within = "within, in 1.96 σ";
  const bool have_sigma = std::ranges::any_of(
      statistics.quantities, [](const auto& of) { return of.standard_errors.has_value(); });
  Table table{.id = "instrument-table",
              .caption = "95 % intervals with the instrument as the unit",
              .rows = std::vector<Row>(statistics.quantities.size()),
              .notes = {"beyond: runs whose error exceeds the objective, or without an estimate"}};
  const std::vector<InstrumentQuantity>& all = statistics.quantities;
  add_column(table, {"parameter", true, 10}, [&](auto i) { return schema.quantities[i].symbol; });
  add_ends(table, {"from", false, 8, "bias"}, {"to", false, 9, "bias"}, [&](auto i) {
    return IntervalAndScale(all[i].error.mean_interval, schema.quantities[i].display_scale);
  });
  add_ends(table, {"from", false, 7, beyond, true}, {"to", false, 7, beyond}, [&](auto i) {
    const auto& share = all[i].beyond;
    return IntervalAndScale(share ? std::optional(share->interval) : std::nullopt, percent_scale);
  });
  if (have_sigma) {
    const auto add_share = [&](Column from, Column to, GroupedShare GroupedStandardErrors::*share) {
      add_ends(table, std::move(from), std::move(to), [&](auto i) {
        const auto& sigma = all[i].standard_errors;
        return IntervalAndScale(sigma ? std::optional(((*sigma).*share).interval) : std::nullopt,
                                percent_scale);
      });
    };
    add_share({"from", false, 7, covered, true}, {"to", false, 7, covered},
              &GroupedStandardErrors::covered);
    add_column(table, {"s²/σ²", false, 7, within, true}, [&](auto i) {
      const auto& sigma = all[i].standard_errors;
      return figure_cell(sigma ? sigma->within_ratio : std::nullopt);
    });
    add_share({"from", false, 7, within}, {"to", false, 7, within},
              &GroupedStandardErrors::covered_within);
    table.notes.emplace_back(
        "within: about the mean of each instrument, whose variance there is s²; from, to in %");
  }
  if (std::ranges::none_of(all, [](const auto& of) { return of.beyond.has_value(); })) return table;
  table.notes.insert(
      table.notes.end(),
      {fmt::format("all objectives (mixed): in {} of all runs", share_text(statistics.mixed)),
       fmt::format("all objectives (ensemble): {} of all instruments meet them in all {} "
                   "realisations",
                   share_text(statistics.ensemble), statistics.realisations),
       temporal_text(statistics)});
  return table;
}

// The library finds these by their arguments, and would not in an unnamed namespace.
static void to_json(Json& json, const GroupedShare& of) {
  json = {{"share", of.share}, {"interval", of.interval}};
}

static void to_json(Json& json, const GroupedStandardErrors& of) {
  json = {{"within_ratio", of.within_ratio},
          {"covered", of.covered},
          {"covered_within", of.covered_within}};
}

static void to_json(Json& json, const InstrumentQuantity& of) {
  const bool is_known = of.error.num_groups > 0;
  const auto if_known = [&](double value) { return is_known ? Json(value) : Json(nullptr); };
  json = {{"mean", if_known(of.mean_magnitude)},
          {"mean_interval", of.magnitude_interval},
          {"bias", if_known(of.error.mean)},
          {"bias_interval", of.error.mean_interval},
          {"between_mean_square", of.error.between_mean_square},
          {"within_mean_square", if_known(of.error.within_mean_square)},
          {"between_standard_deviation", of.error.between_deviation},
          {"within_standard_deviation", if_known(of.error.within_deviation)},
          {"noise_share", of.error.within_share},
          {"noise_share_interval", of.error.within_share_interval},
          {"beyond", of.beyond},
          {"standard_errors", of.standard_errors}};
}

Json json_of(const ResultSchema& schema, const InstrumentStatistics& statistics) {
  Json json{{"realisations", statistics.realisations},
            {"num_instruments", statistics.num_instruments},
            {"num_incomplete", statistics.num_incomplete},
            {"num_not_estimated", statistics.num_not_estimated},
            {"all_objectives", nullptr},
            {"parameters", Json::array()}};
  if (statistics.num_instruments > 0) {
    json["all_objectives"] = {{"mixed", statistics.mixed},
                              {"ensemble", statistics.ensemble},
                              {"temporal",
                               {{"num_realisations", statistics.temporal},
                                {"num_instruments", statistics.num_temporal},
                                {"first_instrument", statistics.temporal_instrument}}}};
  }
  for (std::size_t i = 0; i < statistics.quantities.size(); ++i) {
    Json row{{"parameter", schema.quantities[i].name}};
    row.update(Json(statistics.quantities[i]));
    json["parameters"].push_back(std::move(row));
  }
  return json;
}

}  // namespace proofmass::coordinator
