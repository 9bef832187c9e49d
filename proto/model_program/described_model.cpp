#include "proto/model_program/described_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <mutex>
#include <optional>
#include <utility>
#include <variant>

#include "core/campaign/expression.hpp"
#include "core/campaign/law_keys.hpp"
#include "core/definition/definition_text.hpp"
#include "core/definition/document.hpp"
#include "core/math/hash.hpp"

namespace proofmass::wire {
namespace {

std::string value_text(const DefinitionValue& value) {
  if (const auto* const whole = std::get_if<std::int64_t>(&value)) return fmt::to_string(*whole);
  if (const auto* const number = std::get_if<double>(&value)) return detail::number_text(*number);
  return detail::quoted_text(std::get<std::string>(value));
}

std::string_view name_of(Law law) { return names_of(law)[static_cast<std::size_t>(law) - 1]; }

void read_law(Document& document, const std::string& path, Dispersion& law) {
  const Law before = law.law;
  if (document.read(path + ".law", law.law)) {
    if (!is_law_of_programs(law.law)) {
      document.refuse(path + ".law", laws_of_programs_rule);
      law.law = before;
    }
    if (law.law != before) {
      Dispersion other;
      other.law = law.law;
      law = other;
    }
  }
  for (const std::string_view key : keys_of(law.law)) {
    const std::string key_path = fmt::format("{}.{}", path, key);
    if (!document.read(key_path, *number_at(law, key)) && law.law != before) {
      document.refuse_absence(key_path, fmt::format("the law {} needs it", name_of(law.law)));
    }
  }
}

}  // namespace

DescribedCampaign::DescribedCampaign(const DescribedModel& of) : model_(&of) {
  name = name_of_model(of.version());
  for (const ProgramParameter& parameter : description().parameters) {
    parameters.push_back(parameter.value);
  }
  for (const ProgramDraw& draw : description().drawn) laws.push_back(draw.law);
  for (const ProgramQuantity& quantity : description().quantities) {
    objectives_.push_back(quantity.objective);
  }
}

const Model& DescribedCampaign::model() const { return *model_; }

const ProgramDescription& DescribedCampaign::description() const { return model_->parts(); }

std::unique_ptr<const Plan> DescribedCampaign::prepare() const {
  return model_->program().prepare(*this);
}

std::vector<DefinitionItem> DescribedCampaign::items() const {
  const ProgramDescription& of = description();
  std::vector<DefinitionItem> items{{"campaign.name", name},
                                    {"campaign.seed", static_cast<std::int64_t>(seed)},
                                    {"campaign.runs", static_cast<std::int64_t>(num_runs)}};
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    items.push_back({"parameters." + of.parameters[i].name, parameters[i]});
  }
  for (std::size_t i = 0; i < laws.size(); ++i) {
    const std::string path = "drawn." + of.drawn[i].name;
    Dispersion law = laws[i];
    items.push_back({path + ".law", std::string(name_of(law.law))});
    for (const std::string_view key : keys_of(law.law)) {
      items.push_back({fmt::format("{}.{}", path, key), *number_at(law, key)});
    }
  }
  for (std::size_t i = 0; i < objectives_.size(); ++i) {
    if (std::isfinite(objectives_[i])) {
      items.push_back({"objectives." + of.quantities[i].name, objectives_[i]});
    }
  }
  return items;
}

Definition DescribedCampaign::definition(TableColumns) const {
  std::string text, table;
  for (const DefinitionItem& item : items()) {
    const std::size_t dot = item.key.rfind('.');
    const std::string of = item.key.substr(0, dot);
    if (std::exchange(table, of) != of) {
      text += fmt::format("{}[{}]\n", text.empty() ? "" : "\n", of);
    }
    text += fmt::format("{} = {}\n", item.key.substr(dot + 1), value_text(item.value));
  }
  return {.text = std::move(text), .model = std::string(model_->version())};
}

std::vector<DefinitionDifference> DescribedCampaign::differences_from(const Campaign& other) const {
  // Laws may have different keys: a key that one campaign lacks is a difference, too.
  std::vector<DefinitionItem> others = other.items();
  std::vector<DefinitionDifference> differences;
  const auto differ = [&](const std::string& key, std::string first, std::string second) {
    if (key == "campaign.runs" || first == second) return;
    const std::string_view prefix = "campaign.";
    differences.push_back({key.starts_with(prefix) ? key.substr(prefix.size()) : key,
                           std::move(first), std::move(second)});
  };
  for (const DefinitionItem& item : items()) {
    const auto same = std::ranges::find(others, item.key, &DefinitionItem::key);
    differ(item.key, value_text(item.value),
           same == others.end() ? "none" : value_text(same->value));
    if (same != others.end()) others.erase(same);
  }
  for (const DefinitionItem& item : others) differ(item.key, "none", value_text(item.value));
  return differences;
}

void DescribedCampaign::read(Document& document) {
  const ProgramDescription& of = description();
  auto whole_seed = static_cast<std::int64_t>(seed);
  auto whole_runs = static_cast<std::int64_t>(num_runs);
  document.read("campaign.name", name);
  document.read("campaign.seed", whole_seed, range::not_negative);
  document.read("campaign.runs", whole_runs, range::between(1, double{num_runs_max}));
  seed = static_cast<std::uint64_t>(whole_seed);
  num_runs = static_cast<std::uint64_t>(whole_runs);
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    document.read("parameters." + of.parameters[i].name, parameters[i]);
  }
  for (std::size_t i = 0; i < laws.size(); ++i) {
    read_law(document, "drawn." + of.drawn[i].name, laws[i]);
  }
  for (std::size_t i = 0; i < objectives_.size(); ++i) {
    document.read("objectives." + of.quantities[i].name, objectives_[i], range::positive);
  }
  document.check();
  try {
    validate();
  } catch (const ConfigError& error) {
    throw document.located(error);
  }
}

void DescribedCampaign::validate() const {
  check_identity(*this);
  check_table_columns(*this, {});
  for (std::size_t i = 0; i < laws.size(); ++i) {
    laws[i].validate("drawn." + description().drawn[i].name);
  }
}

RunDraw DescribedCampaign::draw(RunIndex run) const {
  const ProgramDescription& of = description();
  RunDraw draw{.num_draws = 1};
  for (std::size_t i = 0; i < laws.size(); ++i) {
    draw.values.push_back(draw_value(laws[i], of.drawn[i].name, seed, run, 0, 0.0));
  }
  for (const ProgramQuantity& quantity : of.quantities) {
    draw.truth.push_back(evaluate_expression(quantity.truth, [&](std::string_view input) {
      for (std::size_t i = 0; i < parameters.size(); ++i) {
        if (of.parameters[i].name == input) return parameters[i];
      }
      return draw.values[static_cast<std::size_t>(
          std::ranges::find(of.drawn, input, &ProgramDraw::name) - of.drawn.begin())];
    }));
  }
  if (!std::ranges::all_of(draw.truth, is_in_range)) return {.num_draws = 1};
  return draw;
}

ResultSchema DescribedCampaign::results() const {
  ResultSchema schema;
  for (const ProgramQuantity& quantity : description().quantities) {
    schema.quantities.push_back({.name = quantity.name,
                                 .unit_suffix = "",
                                 .symbol = quantity.symbol,
                                 .unit = quantity.unit,
                                 .display_scale = quantity.display_scale,
                                 .display_unit = quantity.display_unit,
                                 .objective = quantity.objective,
                                 .has_standard_error = quantity.has_standard_error});
  }
  schema.loss_causes = {"program"};
  schema.loss_sessions = {"run"};
  return schema;
}

DescribedModel::DescribedModel(ProgramDescription description, std::uint64_t reference_digest)
    : DescribedModel(std::move(description), nullptr) {
  reference_digest_ = reference_digest;
}

DescribedModel::DescribedModel(ProgramDescription description,
                               std::unique_ptr<const RunnableProgram> program)
    : parts_(std::move(description)), program_(std::move(program)) {
  for (const ProgramDraw& draw : parts_.drawn) drawn_.push_back({draw.name, draw.unit});
  example_file_ = DescribedCampaign(*this).name + ".toml";
}

const RunnableProgram& DescribedModel::program() const {
  if (program_) return *program_;
  throw ModelProgramError(fmt::format(
      "model = {} (its program is needed to compute runs: name it with --model-program)",
      version()));
}

ResultSchema DescribedModel::results_of(std::string_view, std::string_view) const {
  return DescribedCampaign(*this).results();
}

std::uint64_t DescribedModel::reference_digest(InstructionSet set) const {
  const std::lock_guard lock(digest_mutex_);
  if (reference_digest_) return *reference_digest_;
  constexpr std::uint64_t num_runs = 3;
  std::uint64_t digest = fnv1a_basis;
  for (const char letter : parts_.text) digest = fnv1a(digest, static_cast<unsigned char>(letter));
  const std::unique_ptr<const Plan> plan = DescribedCampaign(*this).prepare();
  for (std::uint64_t run = 0; run < num_runs; ++run) {
    const RunRequest request{RunIndex{run}, {}};
    const std::vector<RunResult> results = plan->simulate_batch({&request, 1}, set, {});
    for (const double value : results.front().estimate) {
      digest = fnv1a(digest, std::bit_cast<std::uint64_t>(value));
    }
  }
  return *(reference_digest_ = digest);
}

std::unique_ptr<Campaign> DescribedModel::campaign_of(Definition definition, TableColumns,
                                                      std::string_view source) const {
  Document document(std::string(source), definition.text, {});
  auto campaign = std::make_unique<DescribedCampaign>(*this);
  campaign->read(document);
  definition.model = version();
  if (campaign->definition(TableColumns::included) == definition) return campaign;
  throw DefinitionError(fmt::format("{}: is no definition of {}", source, version()));
}

// The program itself has a say, which it has where it runs in all other cases.
std::unique_ptr<Campaign> DescribedModel::read_campaign(Document& document, DataFiles&) const {
  auto campaign = std::make_unique<DescribedCampaign>(*this);
  campaign->read(document);
  try {
    program().check(*campaign);
  } catch (const ConfigError& error) {
    throw document.located(error);
  }
  return campaign;
}

std::string DescribedModel::example() const {
  std::string text = DescribedCampaign(*this).definition(TableColumns::included).text;
  const std::size_t second_line = text.find('\n') + 1;
  return text.insert(second_line, fmt::format("model = \"{}\"\n", name_of_model(version())));
}

namespace {

/// Texts of results point into their model, and so it stays: no more than so many bytes of
/// descriptions, each of some thousand.
constexpr std::size_t descriptions_size_max = std::size_t{64} << 20;

const DescribedModel& described_model(const std::string& text, std::uint64_t reference_digest) {
  static std::mutex mutex;
  static std::map<std::pair<std::string, std::uint64_t>, DescribedModel> models;
  static std::size_t size = 0;
  const std::lock_guard lock(mutex);
  const auto known = models.find({text, reference_digest});
  if (known != models.end()) return known->second;
  if (size + text.size() > descriptions_size_max) {
    throw ModelProgramError(
        fmt::format("description: this program has read {} others, of {} bytes; start it again",
                    models.size(), size));
  }
  ProgramDescription description = description_in(text);
  const auto made =
      models.try_emplace({text, reference_digest}, std::move(description), reference_digest);
  size += text.size();
  return made.first->second;
}

/// One of this program with the same version, and the same description if both have one; or the
/// built-in one if it has the same name: one in C++ knows what its older versions recorded.
const Model* own_model(const ModelRecord& record) {
  const Model* const found = find_model(record.version);
  if (found != nullptr && (found->description().empty() || record.description.empty() ||
                           found->description() == record.description)) {
    return found;
  }
  const std::string_view name = name_of_model(record.version);
  const Model& built_in = built_in_model();
  return name.empty() || name == name_of_model(built_in.version()) ? &built_in : nullptr;
}

/// `hardy2013-6 and oscillator-1`.
std::string own_versions() {
  std::string text;
  for (const Model* const own : models()) {
    text = fmt::format("{}{}{}", own->version(), text.empty() ? "" : " and ", text);
  }
  return text;
}

}  // namespace

const Model& recorded_model(const ModelRecord& record) {
  if (const Model* const own = own_model(record)) return *own;
  if (record.description.empty()) {
    throw ModelProgramError(fmt::format(
        "is of the model {}, and this program has {}; --model-program names that of another model",
        record.version, own_versions()));
  }
  try {
    const Model& described = described_model(record.description, record.reference_digest);
    if (described.version() == record.version) return described;
    throw ModelProgramError(fmt::format("description: of {}", described.version()));
  } catch (const ModelProgramError& error) {
    throw ModelProgramError(fmt::format("is of the model {}: {}", record.version, error.what()));
  }
}

}  // namespace proofmass::wire
