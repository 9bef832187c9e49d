#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/campaign/dispersion.hpp"
#include "core/campaign/law_set.hpp"
#include "core/campaign/recording.hpp"
#include "core/definition/definition_text.hpp"
#include "core/definition/document.hpp"
#include "core/model.hpp"

namespace proofmass {

// Model, Campaign and Plan of an instrument whose campaign file is a list of numbers, so that an
// instrument says only what is its own. It is a class `Settings` of numbers, with nominal values as
// defaults, and
//
//     static constexpr std::string_view name, version, purpose, step_name, example_file;
//     static constexpr std::uint64_t num_runs;                // Of the example campaign.
//     static std::span<const SettingInfo<Settings>> infos();  // Its keys, each table's together.
//     static std::span<const DrawnQuantity> drawn();
//     void check() const;                 // Throws ConfigError: the rules about several keys.
//     ResultSchema results() const;       // With the objectives.
//     std::int64_t num_rounds_max() const;
//     std::vector<double> means() const;  // Of each drawn quantity; deviations() likewise.
//     std::vector<double> truth(std::span<const double> drawn) const;
//     Settings reference() const;         // Short, for the digest.
//     using Simulator = ...;
//
// A Simulator is what runs share: made of Settings, with `Recording recording`, `int num_steps()`
// and `RunResult operator()(seed, run, draw, sink) const`.

/// A key of the campaign file and where its value is.
template <typename Settings>
struct SettingInfo {
  FieldInfo field;
  double Settings::*value;
};

template <typename Settings>
class SettingsCampaign final : public Campaign {
 public:
  SettingsCampaign() {
    name = Settings::name;
    num_runs = Settings::num_runs;
  }

  Settings settings;

  [[nodiscard]] const Model& model() const override { return built_in_model(); }
  void validate() const override {
    check_identity(*this);
    check_table_columns({}, *this);
    for (const auto& info : Settings::infos()) check_field(info.field, settings.*info.value);
    settings.check();
  }
  [[nodiscard]] std::unique_ptr<Campaign> clone() const override {
    return std::make_unique<SettingsCampaign>(*this);
  }
  [[nodiscard]] std::unique_ptr<const Plan> prepare() const override;
  [[nodiscard]] Definition definition(TableColumns /*columns*/) const override {
    return {.text = text(Comments::left_out)};
  }
  [[nodiscard]] std::vector<DefinitionItem> items() const override {
    std::vector<DefinitionItem> items{{"campaign.name", name},
                                      {"campaign.seed", static_cast<std::int64_t>(seed)},
                                      {"campaign.runs", static_cast<std::int64_t>(num_runs)}};
    for (const auto& info : Settings::infos()) {
      items.push_back({std::string(info.field.path), settings.*info.value});
    }
    return items;
  }
  [[nodiscard]] std::vector<DefinitionDifference> differences_from(
      const Campaign& other) const override {
    const std::vector<DefinitionItem> mine = items(), others = other.items();
    std::vector<DefinitionDifference> differences;
    for (std::size_t i = 0; i < mine.size(); ++i) {
      const std::string& key = mine[i].key;
      if (mine[i].value == others[i].value || key == "campaign.runs") continue;
      const bool is_identity = key.starts_with("campaign.");
      differences.push_back({key.substr(is_identity ? 9 : 0), value_text(mine[i].value),
                             value_text(others[i].value)});
    }
    return differences;
  }
  [[nodiscard]] ResultSchema results() const override { return settings.results(); }
  [[nodiscard]] std::vector<double> objectives() const override {
    std::vector<double> objectives;
    for (const Quantity& quantity : results().quantities) objectives.push_back(quantity.objective);
    return objectives;
  }
  [[nodiscard]] std::int64_t num_rounds_max() const override { return settings.num_rounds_max(); }
  [[nodiscard]] std::vector<std::size_t> table_quantities() const override { return {}; }

  [[nodiscard]] RunDraw draw(RunIndex run) const override {
    const std::vector<double> means = settings.means(), deviations = settings.deviations();
    RunDraw draw{.num_draws = 1};
    for (std::size_t i = 0; i < means.size(); ++i) {
      // A deviation of 0 stands for a value that is known.
      Dispersion law{.law = deviations[i] > 0.0 ? Law::normal : Law::fixed};
      law.mean = law.value = means[i];
      law.standard_deviation = deviations[i];
      draw.values.push_back(draw_value(law, Settings::drawn()[i].name, seed, run, 0, 0.0));
    }
    draw.truth = settings.truth(draw.values);
    return draw;
  }

  enum class Comments { included, left_out };

  /// All of the campaign as TOML; without comments it is the one form that campaign_of() takes.
  [[nodiscard]] std::string text(Comments comments) const {
    std::string text, table;
    const auto infos = Settings::infos();
    const std::vector<DefinitionItem> all = items();
    for (std::size_t i = 0; i < all.size(); ++i) {
      const std::size_t dot = all[i].key.find('.');
      if (std::exchange(table, all[i].key.substr(0, dot)) != all[i].key.substr(0, dot)) {
        text += fmt::format("{}[{}]\n", comments == Comments::included && i > 0 ? "\n" : "", table);
      }
      text += fmt::format("{} = {}", all[i].key.substr(dot + 1), value_text(all[i].value));
      if (comments == Comments::included && i >= all.size() - infos.size()) {
        text += fmt::format("  # {}", infos[i + infos.size() - all.size()].field.comment);
      }
      text += "\n";
    }
    return text;
  }

 private:
  [[nodiscard]] static std::string value_text(const DefinitionValue& value) {
    if (const auto* const whole = std::get_if<std::int64_t>(&value)) return fmt::to_string(*whole);
    if (const auto* const number = std::get_if<double>(&value)) return detail::number_text(*number);
    return detail::quoted_text(std::get<std::string>(value));
  }
};

template <typename Settings>
class SettingsPlan final : public Plan {
 public:
  explicit SettingsPlan(const SettingsCampaign<Settings>& campaign)
      : campaign_(campaign), simulate_(campaign.settings) {}

  [[nodiscard]] std::vector<RunResult> simulate_batch(
      std::span<const RunRequest> requests, InstructionSet /*set*/,
      const std::function<void(int)>& progress) const override {
    std::vector<RunResult> results;
    for (const RunRequest& request : requests) results.push_back(replay(request, {}, {}));
    if (progress) progress(num_steps());
    return results;
  }
  [[nodiscard]] RunResult replay(const RunRequest& request, const SampleSink& sink,
                                 const std::function<void(int)>& progress) const override {
    const RunDraw draw = campaign_.draw(request.run);
    RunResult result = simulate_(campaign_.seed, request.run, draw, sink);
    result.run = request.run;
    result.num_draws = draw.num_draws;
    result.truth = draw.truth;
    if (progress) progress(num_steps());
    return result;
  }
  [[nodiscard]] const Recording& recording() const override { return simulate_.recording; }
  [[nodiscard]] int num_steps() const override { return simulate_.num_steps(); }

 private:
  SettingsCampaign<Settings> campaign_;
  typename Settings::Simulator simulate_;
};

template <typename Settings>
std::unique_ptr<const Plan> SettingsCampaign<Settings>::prepare() const {
  return std::make_unique<const SettingsPlan<Settings>>(*this);
}

template <typename Settings>
class SettingsModel final : public Model {
 public:
  [[nodiscard]] std::string_view version() const override { return Settings::version; }
  [[nodiscard]] std::string_view purpose() const override { return Settings::purpose; }
  [[nodiscard]] ResultSchema results_of(std::string_view definition,
                                        std::string_view /*version*/) const override {
    try {
      Document document("definition", definition, {});
      return read(document)->results();
    } catch (const DefinitionError&) {
      return Settings().results();
    }
  }
  [[nodiscard]] std::span<const DataTableSchema> tables() const override { return {}; }
  [[nodiscard]] std::span<const DrawnQuantity> drawn() const override { return Settings::drawn(); }
  [[nodiscard]] std::string_view step_name() const override { return Settings::step_name; }
  [[nodiscard]] std::size_t batch_size() const override { return 1; }

  [[nodiscard]] std::uint64_t reference_digest(InstructionSet set) const override {
    SettingsCampaign<Settings> campaign;
    campaign.settings = campaign.settings.reference();
    const RunRequest request{RunIndex{0}, {}};
    const auto results = campaign.prepare()->simulate_batch({&request, 1}, set);
    std::uint64_t digest = 0;
    for (const double value : results[0].estimate) {
      digest = std::rotl(digest, 1) ^ std::bit_cast<std::uint64_t>(value);
    }
    return digest;
  }
  [[nodiscard]] std::unique_ptr<Campaign> campaign_of(Definition definition, TableColumns,
                                                      std::string_view source) const override {
    Document document(std::string(source), definition.text, {});
    auto campaign = read(document);
    if (campaign->definition(TableColumns::included) == definition) return campaign;
    throw DefinitionError(fmt::format("{}: is not in canonical form", source));
  }
  [[nodiscard]] std::unique_ptr<Campaign> read_campaign(Document& document,
                                                        DataFiles& /*files*/) const override {
    return read(document);
  }
  [[nodiscard]] std::string example() const override {
    using Example = SettingsCampaign<Settings>;
    return Example().text(Example::Comments::included);
  }
  [[nodiscard]] std::string_view example_file() const override { return Settings::example_file; }

 private:
  [[nodiscard]] static std::unique_ptr<SettingsCampaign<Settings>> read(Document& document) {
    auto campaign = std::make_unique<SettingsCampaign<Settings>>();
    auto seed = static_cast<std::int64_t>(campaign->seed);
    auto num_runs = static_cast<std::int64_t>(campaign->num_runs);
    document.read("campaign.name", campaign->name);
    document.read("campaign.seed", seed, range::not_negative);
    document.read("campaign.runs", num_runs, range::between(1, double{num_runs_max}));
    campaign->seed = static_cast<std::uint64_t>(seed);
    campaign->num_runs = static_cast<std::uint64_t>(num_runs);
    for (const auto& info : Settings::infos()) {
      document.read(std::string(info.field.path), campaign->settings.*info.value, info.field.range);
    }
    document.check();
    try {
      campaign->validate();
    } catch (const ConfigError& error) {
      throw document.located(error);
    }
    return campaign;
  }
};

}  // namespace proofmass
