#include "proto/model_program/described_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <map>
#include <mutex>
#include <optional>
#include <utility>

#include "core/campaign/expression.hpp"
#include "core/campaign/law_set.hpp"
#include "core/definition/csv.hpp"
#include "core/definition/document.hpp"
#include "core/definition/entry.hpp"
#include "core/definition/law_reader.hpp"
#include "core/math/hash.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::wire {

DescribedCampaign::DescribedCampaign(const DescribedModel& of)
    : laws(of.parts().laws), model_(&of) {
  name = name_of_model(of.version());
  for (const ProgramParameter& parameter : of.parts().parameters) {
    parameters.push_back(parameter.value);
  }
  for (const ProgramQuantity& quantity : of.parts().quantities) {
    objectives_.push_back(quantity.objective);
  }
}

const Model& DescribedCampaign::model() const { return *model_; }

const ProgramDescription& DescribedCampaign::description() const { return model_->parts(); }

std::unique_ptr<const Plan> DescribedCampaign::prepare() const { return model_->prepare(*this); }

std::string DescribedCampaign::note() const {
  if (model_->is_imported()) {
    return fmt::format("imported from {}: another program computed these results",
                       description().imported_from);
  }
  if (!is_digest_tolerated) return {};
  return "machines with another reference digest were accepted (campaign.tolerate_digest): what a "
         "run computes may depend on its machine";
}

LawSet DescribedCampaign::law_set() const { return description().law_set(laws); }

std::vector<detail::Entry> DescribedCampaign::entries() const {
  const ProgramDescription& of = description();
  std::vector<detail::Entry> entries = detail::campaign_entries(*this);
  if (is_digest_tolerated) entries.push_back({"campaign.tolerate_digest", "true", "", "true"});
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    entries.push_back(detail::real_entry("parameters." + of.parameters[i].name, parameters[i]));
  }
  for (std::size_t i = 0; i < laws.size(); ++i) {
    for (detail::Entry& entry : detail::law_entries(laws[i])) {
      entry.path = fmt::format("{}.{}", law_set().path_of(i), entry.path);
      entries.push_back(std::move(entry));
    }
  }
  for (std::size_t i = 0; i < objectives_.size(); ++i) {
    if (!std::isfinite(objectives_[i])) continue;
    entries.push_back(detail::real_entry("objectives." + of.quantities[i].name, objectives_[i]));
  }
  return entries;
}

std::vector<DefinitionItem> DescribedCampaign::items() const { return detail::items_of(entries()); }

Definition DescribedCampaign::definition(TableColumns columns) const {
  Definition definition{.text = detail::text_of(entries()),
                        .model = std::string(model_->version())};
  if (columns == TableColumns::included) definition.table_columns = table_columns;
  return definition;
}

std::vector<DefinitionDifference> DescribedCampaign::differences_from(const Campaign& other) const {
  const auto* const second = dynamic_cast<const DescribedCampaign*>(&other);
  if (second == nullptr) return {};
  std::vector<DefinitionDifference> differences;
  const bool are_same_drawn = description().drawn_names == second->description().drawn_names;
  for (std::size_t i = 0; are_same_drawn && i < laws.size(); ++i) {
    if (laws[i].law != Law::table || second->laws[i].law != Law::table) continue;
    const auto difference = table_difference({*this, law_set()}, {*second, second->law_set()}, i);
    if (difference) differences.push_back(*difference);
  }
  std::ranges::copy(detail::differences_between(entries(), second->entries()),
                    std::back_inserter(differences));
  return differences;
}

void DescribedCampaign::read(Document& document) {
  const ProgramDescription& of = description();
  read_identity(document, *this);
  document.read("campaign.tolerate_digest", is_digest_tolerated);
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    document.read("parameters." + of.parameters[i].name, parameters[i]);
  }
  const LawSet set = law_set();
  std::vector<std::size_t> with_covariances;
  for (std::size_t i = 0; i < laws.size(); ++i) {
    const std::string path = set.path_of(i);
    laws[i] = read_law(document, path, laws[i], document.is_assigned(path + ".law"));
    if (has_covariances(document, path)) with_covariances.push_back(i);
  }
  for (const std::size_t i : with_covariances) as_correlations(set, laws[i]);
  for (std::size_t i = 0; i < objectives_.size(); ++i) {
    document.read("objectives." + of.quantities[i].name, objectives_[i], range::positive);
  }
  document.check();
}

void DescribedCampaign::validate(TableColumns columns) const {
  check_identity(*this);
  check_laws(law_set());
  check_design(law_set(), *this);
  if (columns == TableColumns::included) check_table_columns(law_set(), *this);
}

RunDraw DescribedCampaign::drawn(RunIndex run, std::span<const double> table_values) const {
  const ProgramDescription& of = description();
  RunDraw draw{.num_draws = 1, .values = std::vector<double>(laws.size())};
  draw_values(law_set(), seed, RunIndex{run.value / realisations}, 0, table_values, design,
              draw.values);
  if (!std::ranges::all_of(draw.values, is_in_range)) return {.num_draws = 1};
  for (const ProgramQuantity& quantity : of.quantities) {
    draw.truth.push_back(evaluate_expression(quantity.truth, [&](std::string_view input) {
      for (std::size_t i = 0; i < parameters.size(); ++i) {
        if (of.parameters[i].name == input) return parameters[i];
      }
      return draw.values[law_set().index_of(input)];
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

DescribedModel::DescribedModel(ProgramDescription description,
                               std::optional<std::uint64_t> reference_digest,
                               PrepareProgram prepare)
    : parts_(std::move(description)),
      prepare_(std::move(prepare)),
      example_file_(fmt::format("{}.toml", name_of_model(parts_.version))),
      reference_digest_(reference_digest) {
  for (std::size_t i = 0; i < parts_.drawn_names.size(); ++i) {
    drawn_.push_back({parts_.drawn_names[i], parts_.drawn_units[i]});
  }
}

std::string DescribedModel::why_no_runs() const {
  if (prepare_) return {};
  if (is_imported()) {
    return fmt::format("its results were imported from {}; no more can be computed",
                       parts_.imported_from);
  }
  if (find_model(version()) != nullptr) return "its program here has another description";
  const auto other = std::ranges::find_if(models(), [this](const Model* model) {
    return name_of_model(model->version()) == name_of_model(version());
  });
  const std::string version_here =
      other == models().end() ? "" : fmt::format(" ({} is)", (*other)->version());
  return fmt::format("its program is not here{}; name it with --model-program", version_here);
}

std::unique_ptr<const Plan> DescribedModel::prepare(const DescribedCampaign& campaign) const {
  if (prepare_) {
    return prepare_(campaign, [this](auto loaded_at) { require_repeatable_since(loaded_at); });
  }
  throw ModelProgramError(fmt::format("model = {} ({})", version(), why_no_runs()));
}

ResultSchema DescribedModel::results_of(std::string_view, std::string_view) const {
  return DescribedCampaign(*this).results();
}

std::unique_ptr<const Plan> DescribedModel::reference_plan() const {
  return prepare_(DescribedCampaign(*this), {});
}

std::uint64_t DescribedModel::digest_of_reference_runs(std::uint64_t digest) const {
  const std::lock_guard lock(reference_mutex_);
  if (reference_runs_.empty()) {
    constexpr std::uint64_t num_runs = 3;
    const std::unique_ptr<const Plan> plan = reference_plan();
    std::vector<RunResult> runs;
    for (std::uint64_t run = 0; run < num_runs; ++run) {
      const RunRequest request{RunIndex{run}, {}};
      runs.push_back(plan->simulate_batch({&request, 1}, best_instruction_set()).front());
    }
    reference_runs_ = std::move(runs);
  }
  for (const RunResult& run : reference_runs_) {
    for (const double value : run.estimate) {
      digest = fnv1a(digest, std::bit_cast<std::uint64_t>(value));
    }
  }
  return digest;
}

std::uint64_t DescribedModel::reference_digest(InstructionSet /*set*/) const {
  return reference_digest_ ? *reference_digest_ : digest_of_reference_runs(parts_.digest);
}

std::uint64_t DescribedModel::former_reference_digest(std::string_view description) const {
  return digest_of_reference_runs(fnv1a(description));
}

void DescribedModel::require_repeatable() const {
  if (reference_digest_) return;
  (void)reference_digest(best_instruction_set());
  require_repeatable_since(std::chrono::steady_clock::time_point::min());
}

// The process that computes the run again is younger than the one in question, so that its code is
// the same or newer. One after the other: each may need as much memory as the program does.
void DescribedModel::require_repeatable_since(
    std::chrono::steady_clock::time_point loaded_at) const {
  const std::lock_guard lock(reference_mutex_);
  if (reference_runs_.empty() || (repeated_at_ && *repeated_at_ >= loaded_at)) return;
  const auto began_at = std::chrono::steady_clock::now();
  wire::require_repeatable(DescribedCampaign(*this), *reference_plan(), reference_runs_.back());
  repeated_at_ = began_at;
}

void require_repeatable(const Model& model) {
  const auto* const described = dynamic_cast<const DescribedModel*>(&model);
  if (described != nullptr) described->require_repeatable();
}

void require_repeatable(const Campaign& campaign, const Plan& plan, const RunResult& result) {
  const RunRequest request{result.run, campaign.table_values(result.run)};
  const std::vector<RunResult> again = plan.simulate_batch({&request, 1}, best_instruction_set());
  if (again.front().status == result.status && again.front().estimate == result.estimate &&
      again.front().standard_error == result.standard_error) {
    return;
  }
  throw ModelProgramChanged(fmt::format(
      "model = {} (run {} has another result when its program is started again: its code has "
      "changed, or an answer follows from more than its question, such as random numbers without "
      "its seeds)",
      campaign.model().version(), result.run.value));
}

std::unique_ptr<Campaign> DescribedModel::campaign_of(Definition definition, TableColumns columns,
                                                      std::string_view source) const {
  check_columns(definition, columns);
  Document document(std::string(source), definition.text, {});
  auto campaign = std::make_unique<DescribedCampaign>(*this);
  campaign->read(document);
  campaign->table_columns = definition.table_columns;
  try {
    campaign->validate(columns);
  } catch (const ConfigError& error) {
    throw document.located(error);
  }
  definition.model = version();
  if (campaign->definition(TableColumns::included) == definition) return campaign;
  throw DefinitionError(fmt::format("{}: is no definition of {}", source, version()));
}

// The program itself has a say, which it has where it runs in all other cases.
std::unique_ptr<Campaign> DescribedModel::read_campaign(Document& document,
                                                        DataFiles& files) const {
  auto campaign = std::make_unique<DescribedCampaign>(*this);
  campaign->read(document);
  try {
    campaign->validate(TableColumns::left_out);
    campaign->table_columns = read_table_columns(
        campaign->law_set(), *campaign, [&](const Dispersion& law, const std::string& path) {
          return parse_column(files.text_of(law.file, path + ".file"), files.name_of(law.file),
                              law.column);
        });
    campaign->validate();
    check_independence(campaign->law_set(), *campaign);
    // With no runs the program does nothing but accept the parameters, or refuse them.
    (void)campaign->prepare()->simulate_batch({}, InstructionSet::scalar);
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

void set_estimates(std::vector<double> estimate, std::vector<double> errors, RunResult& result) {
  const auto is_error = [](double value) { return is_in_range(value) && value >= 0.0; };
  if (!std::ranges::all_of(estimate, is_in_range) || !std::ranges::all_of(errors, is_error)) {
    result.status = RunStatus::not_finite;
    return;
  }
  result.num_rounds = 1;
  if (!errors.empty()) result.correlations.assign(errors.size() * (errors.size() - 1) / 2, 0.0);
  result.estimate = std::move(estimate);
  result.standard_error = std::move(errors);
}

void set_lost(RunResult& result) {
  result.status = RunStatus::lost;
  result.loss = {.cause = 1, .session = 1};
}

/// Texts of results point into their model, and so it stays: no more than so many bytes of
/// descriptions, each of some thousand.
constexpr std::size_t descriptions_size_max = std::size_t{64} << 20;

const DescribedModel& described_model(const std::string& text, std::uint64_t reference_digest,
                                      const std::string& source) {
  static std::mutex mutex;
  static std::map<std::pair<std::string, std::uint64_t>, DescribedModel> models;
  static std::size_t size = 0;
  const std::lock_guard lock(mutex);
  const auto known = models.find({text, reference_digest});
  if (known != models.end()) return known->second;
  if (size + text.size() > descriptions_size_max) {
    throw DefinitionError(
        fmt::format("{}: this program has read {} others, of {} bytes; start it again", source,
                    models.size(), size));
  }
  const auto made = models.try_emplace({text, reference_digest}, description_in(text, source),
                                       reference_digest, nullptr);
  size += text.size();
  return made.first->second;
}

namespace {

/// One in C++ with the same name, which knows what its older versions recorded.
const Model* model_in_cpp(std::string_view version) {
  const std::string_view name = name_of_model(version);
  if (name.empty()) return &built_in_model();
  const auto in_cpp = std::ranges::find_if(models(), [&](const Model* model) {
    return model->description().empty() && name_of_model(model->version()) == name;
  });
  return in_cpp == models().end() ? nullptr : *in_cpp;
}

}  // namespace

const Model& recorded_model(const ModelRecord& record) {
  const Model* const found = find_model(record.version);
  if (found != nullptr && (found->description().empty() || record.description.empty())) {
    return *found;
  }
  if (const Model* const in_cpp = model_in_cpp(record.version)) return *in_cpp;
  if (record.description.empty()) {
    throw DefinitionError(fmt::format(
        "is of the model {}, and this program has {}; --model-program names that of another model",
        record.version, model_versions()));
  }
  const std::string source = fmt::format("is of the model {}: description", record.version);
  const DescribedModel& described =
      described_model(record.description, record.reference_digest, source);
  if (described.version() != record.version) {
    throw DefinitionError(fmt::format("{}: of {}", source, described.version()));
  }
  const bool is_found =
      found != nullptr && found->description_digest() == described.description_digest();
  return is_found ? *found : described;
}

std::uint64_t current_reference_digest(const Model& model, const ModelRecord& record) {
  const auto* const described = dynamic_cast<const DescribedModel*>(&model);
  if (described == nullptr || !described->can_simulate()) return record.reference_digest;
  return described->former_reference_digest(record.description) == record.reference_digest
             ? model.reference_digest(best_instruction_set())
             : record.reference_digest;
}

std::shared_ptr<const Campaign> recorded_campaign(
    const Model& model, const CampaignTexts& record, const std::string& database,
    const std::function<std::vector<double>(const std::string& sql)>& numbers) {
  Definition definition{.text = record.definition};
  for (const DataTableSchema& schema : model.tables()) {
    std::vector<double> values =
        numbers(fmt::format("SELECT {} FROM {}.{} ORDER BY position",
                            fmt::join(schema.columns, ", "), database, schema.table));
    if (values.empty()) continue;
    definition.tables.push_back({.key = std::string(schema.key),
                                 .num_columns = static_cast<std::uint32_t>(schema.columns.size()),
                                 .values = std::move(values)});
  }
  for (const DrawnQuantity& drawn : model.drawn()) {
    std::vector<double> values = numbers(fmt::format(
        "SELECT value FROM {}.dispersion_value WHERE quantity = '{}' ORDER BY run_index", database,
        drawn.name));
    if (!values.empty()) definition.table_columns.push_back(std::move(values));
  }
  std::shared_ptr<const Campaign> campaign =
      model.campaign_of(std::move(definition), TableColumns::included, "stored definition");
  const auto require_same = [](std::string_view field, const std::string& stored,
                               const std::string& defined) {
    if (stored == defined) return;
    throw DefinitionError(fmt::format("campaign.{} = {} (must be {}, as in the definition)", field,
                                      visible_text(stored), visible_text(defined)));
  };
  require_same("name", record.name, campaign->name);
  require_same("seed", record.seed, fmt::to_string(campaign->seed));
  require_same("num_runs", record.num_runs, fmt::to_string(campaign->num_runs));
  return campaign;
}

}  // namespace proofmass::wire
