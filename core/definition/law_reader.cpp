#include "core/definition/law_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>

#include "core/campaign/dispersion.hpp"
#include "core/definition/document.hpp"

namespace proofmass {
namespace {

void read_design(Document& document, SamplingDesign& design) {
  constexpr std::uint64_t nominal_points = 32;
  document.read("campaign.design", design.kind);
  if (design.kind == DesignKind::random) {
    if (document.find("campaign.points") == nullptr) return;
    document.refuse("campaign.points", "only with campaign.design, which is \"random\"");
    return;
  }
  design.points = nominal_points;
  document.read("campaign.points", design.points,
                range::between(2, static_cast<double>(design_points_max)));
}

}  // namespace

void read_identity(Document& document, Campaign& campaign) {
  document.read("campaign.name", campaign.name);
  document.read("campaign.seed", campaign.seed, range::not_negative);
  document.read("campaign.runs", campaign.num_runs, range::between(1, double{num_runs_max}));
  document.read("campaign.realisations", campaign.realisations,
                range::between(1, double{realisations_max}));
  read_design(document, campaign.design);
}

namespace {

constexpr std::string_view independent_key = "independent";
constexpr std::string_view covariances_key = "covariances";  // In place of correlations.
constexpr std::array<std::string_view, 14> all_keys{
    "minimum",       "maximum",      "mean", "standard_deviation", "value",        "file",
    "column",        "values",       "with", "probabilities",      "correlations", "expression",
    independent_key, covariances_key};

/// Reads a list of numbers or of names.
template <typename Item>
bool read_field(Document& document, const std::string& path, std::vector<Item>& items) {
  const toml::node* const found = document.find(path);
  if (found == nullptr) return false;
  const toml::array* const list = found->as_array();
  bool is_list = list != nullptr && list->size() <= law_list_size_max;
  std::vector<Item> read;
  for (std::size_t i = 0; is_list && i < list->size(); ++i) {
    const std::optional<Item> item = (*list)[i].template value<Item>();
    is_list = item.has_value() && !(*list)[i].is_boolean();
    if (is_list) read.push_back(*item);
  }
  if (!is_list) {
    document.refuse(
        path, fmt::format("must be a list of at most {} {}", law_list_size_max,
                          std::is_same_v<Item, double> ? "numbers" : "names of drawn quantities"));
    return false;
  }
  items = std::move(read);
  return true;
}

template <typename Value>
bool read_field(Document& document, const std::string& path, Value& value) {
  return document.read(path, value);
}

bool read_key(Document& document, const std::string& path, std::string_view key,
              Dispersion& dispersion) {
  return std::visit([&](auto* field) { return read_field(document, path, *field); },
                    field_of(dispersion, key));
}

/// Centre of the law that an assignment replaces: by its keys in the file, or else that of `law`.
double replaced_centre(Document& document, const std::string& path, Dispersion law) {
  const auto has = [&](std::string_view key) {
    return read_key(document, fmt::format("{}.{}", path, key), key, law);
  };
  if (has("value")) return law.value;
  if (has("mean")) return law.mean;
  const bool has_minimum = has("minimum");
  const bool has_bounds = has("maximum") && has_minimum;
  if (has_bounds || law.law == Law::uniform) return 0.5 * law.minimum + 0.5 * law.maximum;
  return law.law == Law::fixed ? law.value : law.mean;
}

// Keys that belong to other laws: a mean beside a uniform law would be silently without effect.
// Keys of a law in the file that an assignment replaces are gone with it.
void refuse_other_keys(Document& document, const std::string& path, Law law, bool is_assigned) {
  const std::span<const std::string_view> keys = keys_of(law);
  for (const std::string_view key : all_keys) {
    const std::string key_path = fmt::format("{}.{}", path, key);
    if (std::ranges::find(keys, key) != keys.end()) continue;
    if (law == Law::table && key == independent_key) continue;
    if (law == Law::correlated && key == covariances_key) continue;
    if (document.find(key_path) == nullptr) continue;
    if (is_assigned && !document.is_assigned(key_path)) continue;
    document.refuse(key_path, fmt::format("not a key of law {}, which has {}", name_of(law),
                                          fmt::join(keys, ", ")));
  }
}

/// Reads covariances, which stand for correlations until as_correlations() divides them.
bool read_covariances(Document& document, const std::string& path, Dispersion& dispersion) {
  const std::string key_path = fmt::format("{}.{}", path, covariances_key);
  if (document.find(key_path) == nullptr) return false;
  if (document.find(path + ".correlations") != nullptr) {
    document.refuse(key_path, "stands in place of correlations: leave out one of them");
  } else {
    (void)read_field(document, key_path, dispersion.correlations);
  }
  return true;
}

}  // namespace

Dispersion read_law(Document& document, const std::string& path, const Dispersion& base,
                    bool is_assigned) {
  Law law = base.law;
  const bool has_law = document.read(path + ".law", law);
  const bool is_law_refused = !has_law && document.find(path + ".law") != nullptr;
  if (is_law_refused) {
    for (const std::string_view key : all_keys)
      (void)document.find(fmt::format("{}.{}", path, key));
    return base;
  }
  Dispersion dispersion = law == base.law ? base : Dispersion{};
  dispersion.law = law;
  for (const std::string_view key : keys_of(law)) {
    const std::string key_path = fmt::format("{}.{}", path, key);
    if (key == "correlations" && read_covariances(document, path, dispersion)) continue;
    if (document.find(key_path) != nullptr || law == base.law) {
      read_key(document, key_path, key, dispersion);
    } else if (is_assigned && (key == "value" || key == "mean") && base.law != Law::table) {
      *std::get<double*>(field_of(dispersion, key)) = replaced_centre(document, path, base);
    } else {
      document.refuse_absence(
          key_path, fmt::format("law {} needs it{}", name_of(law),
                                is_assigned ? ": --set " + key_path + "=..." : std::string()));
    }
  }
  if (law == Law::table) {
    // The only key of a law that may be absent: a table is no draw unless somebody says so.
    document.read(fmt::format("{}.{}", path, independent_key), dispersion.is_independent);
  }
  refuse_other_keys(document, path, law, is_assigned);
  return dispersion;
}

bool has_covariances(Document& document, const std::string& path) {
  return document.find(fmt::format("{}.{}", path, covariances_key)) != nullptr;
}

void as_correlations(const LawSet& set, Dispersion& law) {
  for (std::size_t k = 0; k < law.correlations.size(); ++k) {
    if (k >= law.with.size()) return;
    const std::size_t with = set.index_of(law.with[k]);
    if (with == set.laws.size()) continue;
    law.correlations[k] /= law.standard_deviation * set.laws[with].standard_deviation;
  }
}

void check_columns(const Definition& definition, TableColumns columns) {
  if (columns == TableColumns::included || definition.table_columns.empty()) return;
  throw DefinitionError(fmt::format(
      "definition.table_columns = {} of them (must be none, as they come with the runs)",
      definition.table_columns.size()));
}

std::vector<std::vector<double>> read_table_columns(
    const LawSet& set, const Campaign& campaign,
    const std::function<std::vector<double>(const Dispersion& law, const std::string& path)>&
        rows_of) {
  std::vector<std::vector<double>> columns;
  const std::uint64_t realisations = campaign.realisations;
  for (const std::size_t element : table_elements(set.laws)) {
    std::vector<double> rows = rows_of(set.laws[element], set.path_of(element));
    if (realisations == 1) {
      columns.push_back(std::move(rows));
      continue;
    }
    std::vector<double> column(std::min(rows.size() * realisations, campaign.num_runs));
    for (std::size_t run = 0; run < column.size(); ++run) column[run] = rows[run / realisations];
    columns.push_back(std::move(column));
  }
  return columns;
}

}  // namespace proofmass
