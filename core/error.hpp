#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

namespace proofmass {

/// Base of everything that Proofmass throws: the operation cannot be done, for a reason outside it.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A field of a campaign has a value that its rule forbids; reads `field = value (rule)`.
class ConfigError : public Error {
 public:
  ConfigError(std::string_view field, std::string_view value, std::string_view rule);

  /// Dotted path of the offending field, such as `estimation.transient_s`.
  [[nodiscard]] const std::string& field() const { return field_; }

 private:
  std::string field_;
};

/// A public function was handed data that it cannot work with.
class InvalidArgument : public Error {
 public:
  using Error::Error;
};

/// What simulates runs, outside this process, has crashed, hangs, or yields what no simulation
/// does. Nothing is known of the runs. A worker gives them back so: each has as many attempts as if
/// the worker had crashed, which goes on with its other runs.
class SimulationCrash : public Error {
 public:
  using Error::Error;
};

namespace detail {
[[noreturn]] void expectation_failed(const char* condition, const char* file, int line);
}  // namespace detail

}  // namespace proofmass

/// Aborts on a broken invariant between our own parts: no result computed behind one may be stored.
#define PROOFMASS_EXPECT(condition) \
  ((condition) ? void(0) : ::proofmass::detail::expectation_failed(#condition, __FILE__, __LINE__))
