#pragma once

#include "core/error.hpp"

namespace proofmass::coordinator {

/// A campaign database cannot be used as asked; reads `campaign database = path (what is wrong)`.
class StoreError : public Error {
 public:
  using Error::Error;
};

}  // namespace proofmass::coordinator
