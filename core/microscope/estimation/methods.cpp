#include "core/microscope/estimation/methods.hpp"

#include <algorithm>
#include <array>
#include <span>

#include "core/error.hpp"
#include "core/microscope/estimation/hardy2013/hardy2013.hpp"
#include "core/microscope/estimation/joint/joint.hpp"

namespace proofmass {
namespace {

// Positions are sent and stored: add at the end.
constexpr std::array methods{
    hardy2013_method,
    joint_method,
};

constexpr std::array<std::string_view, methods.size()> method_names = [] {
  std::array<std::string_view, methods.size()> names{};
  for (std::size_t i = 0; i < methods.size(); ++i) names[i] = methods[i].name;
  return names;
}();

}  // namespace

const EstimationMethodInfo& estimation_method(EstimationMethod method) {
  const auto position = static_cast<std::size_t>(method) - 1;
  PROOFMASS_EXPECT(position < methods.size());
  return methods[position];
}

std::span<const EstimationMethodInfo> estimation_methods() { return methods; }

ResultSchema results_of(std::span<const EstimationMethodInfo> possible) {
  ResultSchema schema = microscope_results();
  if (std::ranges::none_of(possible, &EstimationMethodInfo::has_standard_errors)) return schema;
  for (Quantity& quantity : schema.quantities) quantity.has_standard_error = true;
  schema.fit = {{"chi_squared", "", "1"}, {"degrees_of_freedom", "", "1"}};
  return schema;
}

std::span<const std::string_view> names_of(Correction) {
  static constexpr std::array<std::string_view, 3> names{"first_order", "second_order",
                                                         "hardy2013"};
  return names;
}

std::span<const std::string_view> names_of(EstimationMethod) { return method_names; }

}  // namespace proofmass
