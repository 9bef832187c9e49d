#pragma once

#include <functional>

#include "core/error.hpp"

namespace proofmass::coordinator {

/// Something cannot be verified, exported or compared as asked; reads `field = value (rule)`.
class ArchiveError : public Error {
 public:
  using Error::Error;
};

/// Somebody asked to stop before the end; nothing was left behind.
class Interrupted : public Error {
 public:
  Interrupted() : Error("interrupted") {}
};

/// Called now and then, on any thread, by what takes long. @throws Interrupted to end it.
using HeedStop = std::function<void()>;

}  // namespace proofmass::coordinator
