#include "coordinator/bench/bench_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <regex>
#include <utility>

#include "coordinator/report/text_cells.hpp"
#include "core/microscope/simulation/run.hpp"

namespace proofmass::coordinator {
namespace {

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
      "Runs       {} a set, scalar 1; of {} orbits and {} steps\n\n{}\n{}",
      machine.processor, machine.num_processors, machine.build_type, machine.compiler,
      model_version, figures.num_runs, figures.num_orbits, figures.num_steps, sets_table(figures),
      step_table(figures.scalar_step));
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
            {"sets", Json::array()},
            {"scalar_step", Json::object()}};
  for (const SetCost& cost : figures.sets) json["sets"].push_back(json_of(figures, cost));
  for (const auto& [name, ns] : rows_of(figures.scalar_step)) {
    json["scalar_step"][key_of(name) + "_ns"] = ns;
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

}  // namespace proofmass::coordinator
