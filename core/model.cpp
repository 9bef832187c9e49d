#include "core/model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace proofmass {
namespace {

void add_linked(std::vector<const Model*>& models) {
  models.push_back(&built_in_model());
  for (const Model* const further : further_models()) models.push_back(further);
}

std::vector<const Model*>& all_models() {
  static std::vector<const Model*> models;
  if (models.empty()) add_linked(models);
  return models;
}

}  // namespace

std::span<const Model* const> models() { return all_models(); }

const Model* find_model(std::string_view version) {
  const auto found = std::ranges::find(all_models(), version, &Model::version);
  return found == all_models().end() ? nullptr : *found;
}

std::string model_versions() {
  std::string text;
  for (const Model* const model : models()) {
    text = fmt::format("{}{}{}", model->version(), text.empty() ? "" : " and ", text);
  }
  return text;
}

std::string_view name_of_model(std::string_view version) {
  const std::size_t end = version.rfind('-');
  return end == version.npos ? std::string_view() : version.substr(0, end);
}

void use_models(std::vector<const Model*> others) {
  add_linked(others);
  all_models() = std::move(others);
}

}  // namespace proofmass
