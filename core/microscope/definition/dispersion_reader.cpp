#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <span>

#include "core/microscope/definition/dispersion_keys.hpp"
#include "core/microscope/definition/readers.hpp"

namespace proofmass::detail {
namespace {

constexpr std::array<std::string_view, 7> all_keys{
    "minimum", "maximum", "mean", "standard_deviation", "value", "file", "column"};

bool read_key(Document& document, const std::string& path, std::string_view key,
              Dispersion& dispersion) {
  if (double* const number = number_at(dispersion, key)) return document.read(path, *number);
  return document.read(path, *text_at(dispersion, key));
}

// Keys that belong to other laws: a mean beside a uniform law would be silently without effect.
void refuse_other_keys(Document& document, const std::string& path, Law law) {
  const std::span<const std::string_view> keys = keys_of(law);
  for (const std::string_view key : all_keys) {
    const std::string key_path = fmt::format("{}.{}", path, key);
    if (std::ranges::find(keys, key) != keys.end()) continue;
    if (document.find(key_path) == nullptr) continue;
    document.refuse(key_path, fmt::format("not a key of law {}, which has {}", name_of(law),
                                          fmt::join(keys, ", ")));
  }
}

// The law at `path` where it differs from an outer one, `base`.
Dispersion read_dispersion(Document& document, const std::string& path, const Dispersion& base) {
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
    const bool is_absent = document.find(key_path) == nullptr;
    if (is_absent && law != base.law) {
      document.refuse_absence(key_path, fmt::format("law {} needs it", name_of(law)));
    } else {
      read_key(document, key_path, key, dispersion);
    }
  }
  refuse_other_keys(document, path, law);
  return dispersion;
}

}  // namespace

DispersionSet read_dispersions(Document& document) {
  DispersionSet dispersions = nominal_dispersions();
  for (const DrawGroup& group : draw_groups()) {
    const Dispersion of_group = read_dispersion(document, fmt::format("dispersion.{}", group.name),
                                                dispersions[group.first]);
    for (std::size_t i = group.first; i < group.first + group.count; ++i) {
      dispersions[i] =
          read_dispersion(document, fmt::format("dispersion.{}", drawn_names()[i]), of_group);
    }
  }
  return dispersions;
}

}  // namespace proofmass::detail
