#include "tests/benchmarks/bench/bench_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <regex>
#include <utility>

#include "coordinator/table/figures.hpp"
#include "coordinator/table/terminal_table.hpp"
#include "core/microscope/simulation/run.hpp"

namespace proofmass::test {
namespace {

using namespace coordinator;  // The cells of tables.

double steps_per_s(const BenchFigures& figures, const SetCost& cost) {
  return static_cast<double>(figures.num_steps) / cost.run_s;
}

double ratio_to_scalar(const BenchFigures& figures, const SetCost& cost) {
  return figures.sets.front().run_s / cost.run_s;
}

/// Time of the noise alone over that of the run: how near the run is to the least that it can cost.
double noise_fraction(const BenchFigures& figures, const SetCost& cost) {
  return cost.noise.step_ns * steps_per_s(figures, cost) / 1e9;
}

std::string set_row(const BenchFigures& figures, const SetCost& cost) {
  const bool is_reference = &cost == &figures.sets.front();
  const std::string_view bits = is_reference              ? "reference"
                                : cost.has_reference_bits ? "same"
                                                          : "different";
  return fmt::format("{}{}{}{}{} │{}{} │ {}\n", left_aligned(name_of(cost.set), 8),
                     right_aligned(measured_figure(cost.run_s), 9),
                     right_aligned(measured_figure(1.0 / cost.run_s), 9),
                     right_aligned(measured_figure(steps_per_s(figures, cost)), 10),
                     right_aligned(measured_figure(ratio_to_scalar(figures, cost)), 10),
                     right_aligned(measured_figure(cost.noise.deviate_ns), 11),
                     right_aligned(measured_figure(noise_fraction(figures, cost)), 9), bits);
}

std::string sets_table(const BenchFigures& figures) {
  std::string text = fmt::format("{:<8}{:>9}{:>9}{:>10}{:>10} │{:>11}{:>9} │ {}\n", "set", "s/run",
                                 "runs/s", "steps/s", "÷ scalar", "ns/deviate", "bound", "bits") +
                     horizontal_rule(47) + "┼" + horizontal_rule(21) + "┼" + horizontal_rule(10) +
                     "\n";
  for (const SetCost& cost : figures.sets) text += set_row(figures, cost);
  return text + "bound: time of the noise alone ÷ time of the run; bits: of all results\n";
}

/// Part of the time that other programs, or other machines on this one, had the processor; below
/// 2 % it is none.
double shared_fraction(const SpentTime& spent) {
  constexpr double fraction_min = 0.02;
  if (spent.wall_s <= 0.0) return 0.0;
  const double fraction = 1.0 - spent.processor_s / spent.wall_s;
  return fraction < fraction_min ? 0.0 : fraction;
}

std::string shared_line(const SpentTime& spent) {
  const double fraction = shared_fraction(spent);
  if (fraction <= 0.0) return "Shared     no: the processor was free\n";
  return fmt::format("Shared     {:.0f} % of the time went to others; figures are processor time\n",
                     100.0 * fraction);
}

/// A batch of one run beside a full one; nothing if the runs did not fill their batches.
std::string widths_table(const BenchFigures& figures) {
  if (figures.num_runs % batch_lanes != 0) return "";
  std::string text =
      fmt::format("Batches\n\n{:<8}{:>10}{:>12}{:>9}\n{}\n", "set", "1 run, s",
                  fmt::format("{} runs, s", batch_lanes), "ratio", horizontal_rule(39));
  for (const SetCost& cost : figures.sets) {
    if (cost.set == InstructionSet::scalar) continue;
    const double full_s = cost.run_s * static_cast<double>(batch_lanes);
    text += fmt::format("{}{}{}{}\n", left_aligned(name_of(cost.set), 8),
                        right_aligned(measured_figure(cost.single_s), 10),
                        right_aligned(measured_figure(full_s), 12),
                        right_aligned(measured_figure(cost.single_s / full_s), 9));
  }
  return text + "\n";
}

std::string start_lines(const StartCost& start) {
  return fmt::format("Start      reference digest {} s, preparing the campaign {} s\n",
                     measured_figure(start.digest_s), measured_figure(start.prepare_s));
}

/// Time of all runs over that of all processors.
double efficiency(const BenchFigures& figures, const CampaignCost& campaign) {
  return campaign.compute_s / (figures.machine.num_processors * campaign.wall_s);
}

std::string campaigns_table(const BenchFigures& figures) {
  if (figures.campaigns.empty()) return "";
  std::string text = fmt::format(
      "\nCampaigns on all {} processors, from the start of the program to its tables\n\n"
      "{:>6}{:>10}{:>10}{:>13}\n{}\n",
      figures.machine.num_processors, "runs", "s", "runs/s", "efficiency", horizontal_rule(39));
  for (const CampaignCost& campaign : figures.campaigns) {
    text += fmt::format(
        "{:>6}{}{}{}\n", campaign.num_runs, right_aligned(measured_figure(campaign.wall_s), 10),
        right_aligned(measured_figure(static_cast<double>(campaign.num_runs) / campaign.wall_s),
                      10),
        right_aligned(measured_figure(efficiency(figures, campaign)), 13));
  }
  return text + "efficiency: time of all runs ÷ (processors × time of the campaign)\n";
}

std::array<std::pair<std::string_view, double>, 5> rows_of(const StepCost& step) {
  return {{{"noise", step.noise_ns},
           {"shared signals", step.shared_signals_ns},
           {"dynamics", step.dynamics_ns},
           {"estimation", step.estimation_ns},
           {"whole", step.whole_ns}}};
}

std::string step_table(const StepCost& step) {
  std::string text =
      "A step of a scalar run; parts are measured alone and need not add up\n\n"
      "part                  ns    share\n" +
      horizontal_rule(33) + "\n";
  for (const auto& [name, ns] : rows_of(step)) {
    text += fmt::format("{:<16}{:>8}{:>7.0f} %\n", name, measured_figure(ns),
                        100.0 * ns / step.whole_ns);
  }
  return text;
}

/// Underscores for spaces.
std::string key_of(std::string_view name) {
  std::string key(name);
  std::replace(key.begin(), key.end(), ' ', '_');
  return key;
}

using Json = nlohmann::ordered_json;

Json json_of(const BenchFigures& figures, const SetCost& cost) {
  return {{"set", name_of(cost.set)},
          {"run_s", cost.run_s},
          {"single_s", cost.single_s},
          {"runs_per_s", 1.0 / cost.run_s},
          {"steps_per_s", steps_per_s(figures, cost)},
          {"ratio_to_scalar", ratio_to_scalar(figures, cost)},
          {"deviate_ns", cost.noise.deviate_ns},
          {"noise_step_ns", cost.noise.step_ns},
          {"fraction_of_bound", noise_fraction(figures, cost)},
          {"has_reference_bits", cost.has_reference_bits}};
}

}  // namespace

std::string bench_table(const BenchFigures& figures) {
  const Machine& machine = figures.machine;
  return fmt::format(
      "Processor  {}, {} processors; one is used\n"
      "Build      {}, {}\n"
      "Model      {}\n"
      "{}{}"
      "Runs       {} a set, scalar 1; of {} orbits and {} steps\n\n{}\n{}{}{}",
      machine.processor, machine.num_processors, machine.build_type, machine.compiler,
      model_version, shared_line(figures.spent), start_lines(figures.start), figures.num_runs,
      figures.num_orbits, figures.num_steps, sets_table(figures), widths_table(figures),
      step_table(figures.scalar_step), campaigns_table(figures));
}

std::string bench_json(const BenchFigures& figures) {
  const Machine& machine = figures.machine;
  Json json{{"processor", machine.processor},
            {"num_processors", machine.num_processors},
            {"compiler", machine.compiler},
            {"build_type", machine.build_type},
            {"model_version", model_version},
            {"num_runs", figures.num_runs},
            {"num_orbits", figures.num_orbits},
            {"num_steps", figures.num_steps},
            {"all_bits_agree", all_bits_agree(figures)},
            {"shared_fraction", shared_fraction(figures.spent)},
            {"digest_s", figures.start.digest_s},
            {"prepare_s", figures.start.prepare_s},
            {"sets", Json::array()},
            {"scalar_step", Json::object()},
            {"campaigns", Json::array()}};
  for (const SetCost& cost : figures.sets) json["sets"].push_back(json_of(figures, cost));
  for (const auto& [name, ns] : rows_of(figures.scalar_step)) {
    json["scalar_step"][key_of(name) + "_ns"] = ns;
  }
  for (const CampaignCost& campaign : figures.campaigns) {
    json["campaigns"].push_back({{"num_runs", campaign.num_runs},
                                 {"wall_s", campaign.wall_s},
                                 {"compute_s", campaign.compute_s},
                                 {"efficiency", efficiency(figures, campaign)}});
  }
  return json.dump(2) + "\n";
}

bool all_bits_agree(const BenchFigures& figures) {
  return std::all_of(figures.sets.begin(), figures.sets.end(),
                     [](const SetCost& cost) { return cost.has_reference_bits; });
}

std::string processor_name(const std::string& cpuinfo) {
  std::smatch match;
  const std::regex pattern("(?:^|\n)model name[ \t]*: ([^\n]+)");
  return std::regex_search(cpuinfo, match, pattern) ? match[1].str() : "unknown";
}

}  // namespace proofmass::test
