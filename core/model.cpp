#include "core/model.hpp"

namespace proofmass {
namespace {

const Model*& used_model() {
  static const Model* used = nullptr;
  return used;
}

}  // namespace

const Model& model() { return used_model() != nullptr ? *used_model() : built_in_model(); }

void use_model(const Model& other) { used_model() = &other; }

}  // namespace proofmass
