#pragma once

#include <string_view>

#include "core/error.hpp"

namespace proofmass::coordinator {

/// What a StoreError says first of a file that nothing more can be written to.
inline constexpr std::string_view disk_full_text = "the disk is full";

/// A campaign database cannot be used as asked; reads `campaign database = path (what is wrong)`.
class StoreError : public Error {
 public:
  using Error::Error;
};

}  // namespace proofmass::coordinator
