#include "coordinator/report/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

#include "coordinator/report/json.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/report/requirements.hpp"
#include "coordinator/report/review.hpp"
#include "coordinator/report/standard_errors.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/independence.hpp"
#include "core/model.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {

std::string report_text(const Review& review, Paint paint) {
  const ReadResults& results = review.results;
  std::string text = fitted(wire::visible_lines(summary_text(review))) +
                     given_up_text(results.given_up, paint) + note_text(review.note) +
                     fitted(wire::visible_lines(warnings_text(review.schema, results.warnings) +
                                                (review.stop ? review.stop->text : "")));
  std::vector<Table> tables{accuracy_table(review), interval_table(review), error_table(review)};
  const auto further = std::back_inserter(tables);
  std::ranges::move(standard_error_tables(review.schema, results.standard_errors), further);
  std::ranges::move(group_tables(review), further);
  tables.push_back(budget_table(review));
  for (const Table& table : tables) {
    if (!table.rows.empty()) text += "\n" + terminal_text(table, document_style(paint));
  }
  return text;
}

std::string note_text(const std::string& note) {
  if (note.empty()) return {};
  return fitted("Note      " + wire::visible_text(note));
}

std::vector<Row> summary_rows(const Review& review) {
  const CampaignStatistics& statistics = review.results.statistics;
  std::vector<Row> rows{{"Campaign", review.name}};
  if (!review.is_imported) rows.push_back({"Seed", std::to_string(review.seed)});
  rows.push_back({"Digest", review.results.digests.results});
  if (!review.results.is_digest_checked) {
    rows.push_back(
        {"", fmt::format("(not checked: no stored one of these {} runs)", statistics.num_runs)});
  }
  rows.push_back({"Runs", fmt::format("{} finished of {}, {} completed{}", statistics.num_runs,
                                      review.num_runs, statistics.num_estimated,
                                      review.is_cancelled ? "; the campaign was cancelled" : "")});
  if (statistics.num_estimated < statistics.num_runs) {
    const MissingEstimates& missing = review.results.missing;
    rows.push_back(
        {"", fmt::format("{} not converged, {} not finite, {} without draw{}",
                         missing.num_not_converged, missing.num_not_finite, missing.num_no_draw,
                         missing.num_lost > 0 ? fmt::format(", {} lost", missing.num_lost) : "")});
  }
  for (const LostRuns& lost : review.results.losses) {
    rows.push_back(
        {"", fmt::format("{} lost: {}", lost.num_runs, loss_text(review.schema, lost.loss))});
  }
  return rows;
}

std::string summary_text(const Review& review) {
  std::string text;
  for (const Row& row : summary_rows(review)) {
    text += fmt::format("{:<10}{}\n", row[0].text, row[1].text);
  }
  return text;
}

std::string given_up_text(std::span<const RunRange> given_up, Paint paint) {
  if (given_up.empty()) return "";
  constexpr std::size_t columns_max = 76;  // And an ellipsis.
  std::string line = fmt::format("          {} given up, having crashed:", num_runs_in(given_up));
  for (const RunRange& range : given_up) {
    const std::string item = range.count == 1
                                 ? fmt::format(" {}", range.first.value)
                                 : fmt::format(" {}..{}", range.first.value, range.end() - 1);
    if (line.size() + item.size() > columns_max)
      return in_tone(line + " ...", Tone::bad, paint) + "\n";
    line += item;
  }
  return in_tone(line, Tone::bad, paint) + "\n";
}

namespace {

Json percentiles_of(const AccuracyStatistic& accuracy) {
  Json json = Json::array();
  for (const PercentileStatistic& percentile : accuracy.percentiles) {
    if (percentile.level == 0.0) continue;  // Not computed, see RunningStatistics.
    json.push_back({{"level", percentile.level},
                    {"value", percentile.value},
                    {"interval", percentile.interval}});
  }
  return json;
}

/// What a number of runs cannot tell is null.
Json statistics_of(const AccuracyStatistic& accuracy, std::uint64_t num_runs) {
  const ErrorStatistic& error = accuracy.error;
  Json json{{"worst", accuracy.worst},
            {"worst_run", accuracy.worst_run.value},
            {"mean", accuracy.mean},
            {"mean_interval", accuracy.mean_interval},
            {"standard_deviation", accuracy.standard_deviation},
            {"standard_deviation_interval", accuracy.deviation_interval},
            {"percentiles", percentiles_of(accuracy)},
            {"bias", error.bias},
            {"bias_interval", error.bias_interval},
            {"error_rms", error.rms},
            {"error_standard_deviation", error.standard_deviation},
            {"error_standard_deviation_interval", error.deviation_interval},
            {"error_skewness", error.skewness},
            {"num_beyond_objective", accuracy.num_beyond_objective},
            {"fraction_beyond_objective", nullptr},
            {"fraction_beyond_objective_interval", accuracy.beyond_objective}};
  if (num_runs == 0) {
    for (const auto& item : json.items()) item.value() = nullptr;
    return json;
  }
  json["fraction_beyond_objective"] =
      static_cast<double>(accuracy.num_beyond_objective) / static_cast<double>(num_runs);
  if (num_runs < 2) json["standard_deviation"] = json["error_standard_deviation"] = nullptr;
  if (num_runs < 3) json["error_skewness"] = nullptr;
  return json;
}

Json parameters_of(const std::vector<Quantity>& quantities, const std::vector<double>& objectives,
                   const CampaignStatistics& statistics) {
  Json json = Json::array();
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    Json parameter{{"parameter", quantities[i].name},
                   {"symbol", quantities[i].symbol},
                   {"unit", quantities[i].unit},
                   {"objective", objectives[i]}};  // Infinity becomes null.
    parameter.update(statistics_of(statistics.accuracy[i], statistics.num_estimated));
    if (!std::isfinite(objectives[i])) {
      for (const char* key : {"num_beyond_objective", "fraction_beyond_objective",
                              "fraction_beyond_objective_interval"}) {
        parameter[key] = nullptr;
      }
    }
    json.push_back(std::move(parameter));
  }
  return json;
}

Json budget_of(const Review& review) {
  const std::optional<ErrorBudget>& budget = review.budget;
  const ReadResults& results = review.results;
  if (!budget) return nullptr;
  const auto& [before, worst, mean] = budget_columns(*budget, results.statistics);
  const auto row = [&](std::string_view name, const auto& value_of) -> Json {
    return {{"term", name},
            {"before_m_s2", value_of(before)},
            {"after_worst_m_s2", worst ? Json(value_of(*worst)) : Json(nullptr)},
            {"after_mean_m_s2", mean ? Json(value_of(*mean)) : Json(nullptr)}};
  };
  Json json{{"terms", Json::array()},
            {"total", row(budget->total_info.name, [](const Budget& of) { return of.total; })},
            {"single_runs", nullptr},
            {"level",
             {{"quantity", review.schema.health.at(budget->level).column()},
              {"worst", nullptr},
              {"mean", nullptr},
              {"assumed", budget->assumed_level}}}};
  for (std::size_t i = 0; i < budget->terms.size(); ++i) {
    json["terms"].push_back(
        row(budget->terms[i].info.name, [&](const Budget& of) { return of.entries[i]; }));
  }
  if (const auto& health = results.statistics.health; !health.empty()) {
    json["level"]["worst"] = health.at(budget->level).worst;
    json["level"]["mean"] = health.at(budget->level).mean;
  }
  if (const std::optional<RunTotals>& totals = results.totals) {
    json["single_runs"] = {{"median_m_s2", totals->median},
                           {"percentile_95_m_s2", totals->percentile_95},
                           {"worst_m_s2", totals->worst},
                           {"worst_run", totals->worst_run.value}};
  }
  return json;
}

Json warnings_of(const ResultSchema& schema, const CampaignWarnings& warnings) {
  return array_of(warnings.quantities, [&](const WarnedQuantity& of) -> Json {
    return {{"effect", of.effect},
            {"parameter", schema.quantities[of.quantity].name},
            {"num_runs", of.num_runs},
            {"largest_part", of.largest_part},
            {"largest_run", of.run.value}};
  });
}

/// Null without standard errors.
Json standard_errors_of(const ResultSchema& schema, const StandardErrorStatistics& statistics) {
  if (statistics.quantities.empty()) return nullptr;
  const auto of_quantity = [&](const StandardErrorStatistic& of) -> Json {
    return {{"parameter", schema.quantities[of.quantity].name},
            {"num_runs", of.num_runs},
            {"mean", of.mean},
            {"squared_ratio", of.squared_ratio},
            {"squared_ratio_standard_error", of.squared_ratio_error},
            {"num_within_95", of.num_within},
            {"fraction_within_95_interval", of.within}};
  };
  const auto of_session = [](const FitStatistic& of) -> Json {
    return {{"session", of.session},
            {"mean_chi_squared", of.chi_squared},
            {"mean_degrees_of_freedom", of.degrees_of_freedom},
            {"ratio_standard_error", of.ratio_error},
            {"p_value", of.p_value}};
  };
  return {{"parameters", array_of(statistics.quantities, of_quantity)},
          {"fit", array_of(statistics.fit, of_session)}};
}

Json json_of_all(const RequirementAnswer& answer) {
  if (!answer.of_all) return nullptr;
  return {{"num_runs", answer.of_all->num_runs},
          {"num_exceedances", answer.of_all->num_exceedances},
          {"exceedance_interval", answer.exceedance_of_all()},
          {"is_opposed", answer.is_opposed()}};
}

Json json_of(const RequirementAnswer& answer) {
  const RequirementCheck& check = answer.check;
  const Requirement& requirement = answer.requirement;
  return {{"requirement", answer.stated.requirement},
          {"answer", name_of(check.verdict)},
          {"rule", check.is_of_fixed_size ? "fixed size" : "sequential"},
          {"parameter", answer.is_joint() ? Json(nullptr) : Json(answer.subject.name)},
          {"limit", answer.is_joint() ? Json(nullptr) : Json(requirement.limit)},
          {"coverage", requirement.tolerance.coverage},
          {"confidence", requirement.tolerance.confidence},
          {"num_runs", check.num_runs},
          {"num_left_out", answer.num_left_out},
          {"num_exceedances", check.num_exceedances},
          {"num_without_estimate", check.num_without_estimate},
          {"num_exceedances_allowed",
           check.bound_order > 0 ? Json(check.bound_order - 1) : Json(nullptr)},
          {"exceedance_bounds", check.exceedance},
          {"all_runs", json_of_all(answer)},
          {"tolerance_bound", answer.is_joint() ? Json(nullptr) : Json(answer.bound)},
          {"assumption", text_or_null(answer.assumption)},
          {"num_runs_at_best", check.num_runs_at_best},
          {"num_runs_at_this_rate", check.num_runs_at_this_rate}};
}

Json json_of(const RequirementAnswer& row, Interpretation interpretation) {
  Json json{{"id", row.stated.id},
            {"text", row.stated.text},
            {"interpretation", name_of(interpretation)},
            {"bound", row.bound},
            {"relative_margin", row.relative_margin()},
            {"worst_run", row.worst ? Json(row.worst->run.value) : Json(nullptr)},
            {"worst_value", row.worst ? Json(row.worst->value) : Json(nullptr)}};
  json.update(json_of(row));
  json["limit"] = row.limit();
  return json;
}

/// Null without a stop rule.
Json stop_of(const std::optional<StopOutcome>& outcome) {
  if (!outcome) return nullptr;
  const bool is_checked = outcome->check.has_value();
  const StopCheckRow row = outcome->check.value_or(StopCheckRow{});
  return {{"rule", outcome->rule},
          {"answer", is_checked ? Json(outcome->answer) : Json(nullptr)},
          {"is_missed", outcome->is_missed},
          {"num_runs", is_checked ? Json(row.num_runs) : Json(nullptr)},
          {"estimate", is_checked ? Json(row.check.estimate) : Json(nullptr)},
          {"interval", row.check.interval},
          {"relative_half_width", row.check.relative_half_width}};
}

}  // namespace

Json report_json(const Review& review, std::span<const StatedRequirement> stated) {
  const ResultSchema& schema = review.schema;
  const ReadResults& results = review.results;
  const CampaignStatistics& statistics = results.statistics;
  const MissingEstimates& missing = results.missing;
  const auto of_loss = [&](const LostRuns& lost) -> Json {
    return {{"cause", name_at(schema.loss_causes, lost.loss.cause)},
            {"session", name_at(schema.loss_sessions, lost.loss.session)},
            {"num_runs", lost.num_runs}};
  };
  const auto of_stated = [&](const StatedRequirement& each) {
    return json_of(answer_to(each, review));
  };
  Json json{{"campaign", review.name},
            {"seed", std::to_string(review.seed)},
            {"digest", results.digests.results},
            {"note", review.note},
            {"is_digest_checked", results.is_digest_checked},
            {"num_runs", review.num_runs},
            {"num_finished", statistics.num_runs},
            {"num_with_estimate", statistics.num_estimated},
            {"num_not_converged", missing.num_not_converged},
            {"num_not_finite", missing.num_not_finite},
            {"num_no_draw", missing.num_no_draw},
            {"num_lost", missing.num_lost},
            {"losses", array_of(results.losses, of_loss)},
            {"num_given_up", missing.num_given_up},
            {"num_contradicting", review.num_contradicting},
            {"num_warned", results.warnings.num_runs},
            {"warnings", warnings_of(schema, results.warnings)},
            {"confidence", default_confidence},
            {"parameters", parameters_of(schema.quantities, review.objectives, statistics)},
            {"all_objectives",
             {{"num_within", statistics.num_within_objectives},
              {"num_runs", statistics.num_runs + missing.num_given_up},
              {"fraction_within_interval", statistics.within_objectives(missing.num_given_up)}}},
            {"standard_errors", standard_errors_of(schema, results.standard_errors)},
            {"budget", budget_of(review)},
            {"stop", stop_of(review.stop)},
            {"requirements", array_of(stated, of_stated)},
            {"matrix", Json::array()}};
  if (results.instruments) json["instruments"] = json_of(schema, *results.instruments);
  if (results.replicates) json["replicates"] = json_of(schema, *results.replicates);
  json["why_not_independent"] = review.why_not_independent;
  if (!review.why_not_independent.empty()) return json;
  json["matrix"] = array_of(review.matrix, [&](const RequirementAnswer& row) {
    return json_of(row, review.interpretation);
  });
  return json;
}

std::string_view cause_of_contradictions(const Model& model) {
  if (model.description().empty()) return "a worker computes wrongly";
  return "answers of the model program depend on more than their question, such as earlier runs or "
         "random numbers without its seeds, or a worker computes wrongly";
}

namespace {

std::string note_of(const Campaign& campaign, const Store& store, const JudgedRuns& judged) {
  std::vector<std::string> notes;
  if (std::string of_campaign = campaign.note(); !of_campaign.empty()) {
    notes.push_back(std::move(of_campaign));
  }
  if (judged.num_left_out > 0) {
    notes.push_back(fmt::format(
        "run {} is not finished, and {} after it are: if runs take longer because of what they "
        "draw, all figures but verdicts, which are about the runs before it, are biased",
        judged.end, counted(judged.num_left_out, "run")));
  }
  if (const std::uint64_t num_contradicting = store.num_contradicting(); num_contradicting > 0) {
    notes.push_back(fmt::format(
        "audits found {}: {}, and no verdict can be relied on; `proofmass verify` "
        "names the runs",
        counted(num_contradicting, "contradiction"), cause_of_contradictions(store.model())));
  }
  return fmt::format("{}", fmt::join(notes, "; "));
}

Review read_of_one_state(const Store& store, const Campaign& campaign, ReviewDepth depth,
                         std::vector<StatedRequirement> stated) {
  const std::vector<RunRange> finished = store.finished_runs();
  const JudgedRuns judged = judged_runs(finished, store.given_up_runs());
  Review review{.name = store.name(),
                .seed = store.seed(),
                .num_runs = store.num_runs(),
                .num_runs_fixed = store.num_runs_fixed(),
                .model_version = store.model_version(),
                .is_of_program = !store.model().description().empty(),
                .is_imported = store.model().is_imported(),
                .note = note_of(campaign, store, judged),
                .build = store.build(),
                .created_utc = store.created_utc(),
                .definition_digest = store.table_digest(),
                .schema = store.schema(),
                .objectives = campaign.objectives(),
                .interpretation = campaign.interpretation(),
                .budget = campaign.error_budget(),
                .why_not_independent = why_not_independent(campaign),
                .num_contradicting = store.num_contradicting()};
  const bool are_independent = review.why_not_independent.empty();
  ErrorFigures figures(review.objectives.size(), num_runs_in(finished), are_independent);
  VerificationMatrix matrix(store.schema(), std::move(stated), review.objectives, judged,
                            review.num_runs_fixed, review.budget);
  review.results = read_checked_results(
      store, campaign,
      {.result =
           [&](const RunResult& result) {
             if (depth >= ReviewDepth::charts) figures.add(result);
             matrix.add(result);
           },
       .magnitudes = [&](std::size_t quantity,
                         auto magnitudes) { matrix.add_magnitudes(quantity, magnitudes); }});
  review.matrix = matrix.answers();
  if (depth == ReviewDepth::matrix) return review;
  review.execution = store.execution();
  review.figures = figures.figures();
  if (are_independent && depth == ReviewDepth::causes) review.causes = find_causes(store, campaign);
  return review;
}

}  // namespace

std::optional<RunIndex> worst_run_of(const Review& review) {
  for (const RequirementAnswer& row : review.matrix) {
    if (row.is_joint() && row.worst) return row.worst->run;
  }
  return std::nullopt;
}

const RequirementAnswer& answer_to(const StatedRequirement& stated, const Review& review) {
  return *std::ranges::find(review.matrix, stated.id,
                            [](const auto& row) { return row.stated.id; });
}

Review read_review(const Store& store, const Campaign& campaign, ReviewDepth depth,
                   std::vector<StatedRequirement> stated) {
  Review review;
  if (!stated.empty()) require_independent(campaign, "requirement", stated.front().requirement);
  stated = matrix_requirements(store.schema(), std::move(stated), campaign.objectives());
  store.read_one_state([&] {
    review = read_of_one_state(store, campaign, depth, std::move(stated));
    review.is_cancelled = store.control().phase == wire::CampaignPhase::cancelled;
    review.stop = stop_outcome(store);
  });
  return review;
}

}  // namespace proofmass::coordinator
