#pragma once

#include <fmt/format.h>

#include <bit>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/dispersion.hpp"
#include "core/campaign/law_set.hpp"
#include "core/campaign/recording.hpp"
#include "core/definition/document.hpp"
#include "core/definition/entry.hpp"
#include "core/model.hpp"

namespace proofmass {

// Model, Campaign and Plan of an instrument whose campaign file is a list of numbers, so that an
// instrument says only what is its own. It is a class `Settings` of numbers, with nominal values as
// defaults, and
//
//     static constexpr std::string_view name, version, purpose, step_name, example_file;
//     static constexpr std::uint64_t num_runs;                // Of the example campaign.
//     static constexpr std::size_t batch_size;                // Runs that are simulated together.
//     static std::span<const SettingInfo<Settings>> infos();  // Its keys, each table's together.
//     static std::span<const DrawnQuantity> drawn();
//     void check() const;                 // Throws ConfigError: the rules about several keys.
//     ResultSchema results() const;       // With the objectives.
//     std::int64_t num_rounds_max() const;
//     std::vector<Dispersion> laws() const;  // Of each drawn quantity, none of another one.
//     std::vector<double> truth(std::span<const double> drawn) const;
//     Settings reference() const;         // Short, for the digest.
//     using Simulator = ...;
//
// A Simulator is what runs share: made of Settings, with `Recording recording`, `int num_steps()`
// and `RunResult operator()(seed, run, draw, sink) const`.

/// The law normal; a deviation of 0 stands for a value that is known.
[[nodiscard]] inline Dispersion normal_law(double mean, double standard_deviation) {
  Dispersion law{.law = standard_deviation > 0.0 ? Law::normal : Law::fixed};
  law.mean = law.value = mean;
  law.standard_deviation = standard_deviation;
  return law;
}

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
  void validate(TableColumns /*columns*/ = TableColumns::included) const override {
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
    return {.text = detail::text_of(entries(), "")};
  }
  [[nodiscard]] std::vector<DefinitionItem> items() const override {
    return detail::items_of(entries());
  }
  [[nodiscard]] std::vector<DefinitionDifference> differences_from(
      const Campaign& other) const override {
    return detail::differences_between(entries(),
                                       dynamic_cast<const SettingsCampaign&>(other).entries());
  }
  [[nodiscard]] ResultSchema results() const override { return settings.results(); }
  [[nodiscard]] std::vector<double> objectives() const override {
    std::vector<double> objectives;
    for (const Quantity& quantity : results().quantities) objectives.push_back(quantity.objective);
    return objectives;
  }
  [[nodiscard]] std::int64_t num_rounds_max() const override { return settings.num_rounds_max(); }

  [[nodiscard]] RunDraw draw(RunIndex run) const override {
    RunDraw draw{.num_draws = 1};
    for (const Dispersion& law : settings.laws()) {
      const std::string_view of = Settings::drawn()[draw.values.size()].name;
      draw.values.push_back(draw_value(law, of, seed, run, 0, 0.0));
    }
    draw.truth = settings.truth(draw.values);
    return draw;
  }

  /// The keys of its campaign file.
  [[nodiscard]] std::vector<detail::Entry> entries() const {
    std::vector<detail::Entry> entries = detail::campaign_entries(*this);
    for (const auto& [field, value] : Settings::infos()) {
      entries.push_back(
          detail::real_entry(field.path, settings.*value, std::string(field.comment)));
    }
    return entries;
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
  [[nodiscard]] std::span<const DrawnQuantity> drawn() const override { return Settings::drawn(); }
  [[nodiscard]] std::string_view step_name() const override { return Settings::step_name; }
  [[nodiscard]] std::size_t batch_size() const override { return Settings::batch_size; }

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
    return detail::text_of(SettingsCampaign<Settings>().entries(), "\n",
                           detail::Comments::included);
  }
  [[nodiscard]] std::string_view example_file() const override { return Settings::example_file; }

 private:
  [[nodiscard]] static std::unique_ptr<SettingsCampaign<Settings>> read(Document& document) {
    auto campaign = std::make_unique<SettingsCampaign<Settings>>();
    document.read("campaign.name", campaign->name);
    document.read("campaign.seed", campaign->seed, range::not_negative);
    document.read("campaign.runs", campaign->num_runs, range::between(1, double{num_runs_max}));
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
