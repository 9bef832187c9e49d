#pragma once

#include "core/error.hpp"

namespace proofmass::coordinator {

/// A campaign file cannot be used as asked; reads `campaign file = path (what is wrong)`.
class StoreError : public Error {
 public:
  using Error::Error;
};

}  // namespace proofmass::coordinator
