#include <cstdint>
#include <string>

#include "core/microscope/definition/readers.hpp"

namespace proofmass::detail {
namespace {

struct FieldReader {
  Document& document;

  void operator()(const FieldInfo& field, double& value) const {
    document.read(std::string(field.path), value, field.range);
  }
  void operator()(const FieldInfo& field, std::int64_t& value) const {
    document.read(std::string(field.path), value, field.range);
  }
  template <typename Choice>
  void operator()(const FieldInfo& field, Choice& value) const {
    document.read(std::string(field.path), value);
  }
};

}  // namespace

void read_scenario(Document& document, Scenario& scenario) {
  // The preset sets the values that the other keys of noise then replace.
  NoisePreset preset = scenario.noise.preset;
  document.read("noise.preset", preset);
  scenario.noise = noise_preset(preset);
  for_each_field(scenario, FieldReader{document});
}

}  // namespace proofmass::detail
