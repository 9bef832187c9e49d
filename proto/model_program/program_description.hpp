#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/dispersion.hpp"
#include "core/campaign/law_set.hpp"
#include "core/campaign/run_result.hpp"
#include "core/error.hpp"

namespace proofmass {
class Document;
}  // namespace proofmass

namespace proofmass::wire {

/// A model program cannot be started, ended, is silent, answers what it must not, or is not there.
class ModelProgramError : public Error {
 public:
  using Error::Error;
};

/// Most bytes of a line that a model program answers, and of a description.
inline constexpr std::size_t answer_size_max = std::size_t{1} << 20;

/// What a model program may take.
struct ProgramLimits {
  std::size_t answer_time_max_s = 600;  ///< For each answer.
  std::size_t memory_max_mib = 4096;    ///< Of data, which counts once it is asked for.
};

/// A number that the runs of a campaign share, and that a campaign file may change.
struct ProgramParameter {
  std::string name;
  double value = 0.0;  ///< Unless the campaign file has another one.
};

/// Most runs that a program is asked for together.
inline constexpr std::size_t runs_at_once_max = 64;

/// What a model program estimates in each run. The engine knows the true value: an expression of
/// drawn quantities and parameters, see evaluate_expression().
struct ProgramQuantity {
  std::string name;
  std::string symbol;      ///< For people; the name by default.
  std::string unit = "1";  ///< SI.
  double display_scale = 1.0;
  std::string display_unit;  ///< That of `unit` by default.
  std::string truth;
  double objective = std::numeric_limits<double>::infinity();
  bool has_standard_error = false;
};

/// What a model program says of itself when it is asked.
struct ProgramDescription {
  std::string text;     ///< All of it as JSON without blanks, keys in alphabetical order.
  std::string version;  ///< NAME-VERSION, as Model::version().
  std::string purpose;
  /// The file that results of another program came from, which are all that there is of the model:
  /// no program computes it again. Empty for a model program.
  std::string imported_from;
  std::vector<ProgramParameter> parameters;
  std::vector<std::string> drawn_names;  ///< Of what it draws for each run.
  std::vector<std::string> drawn_units;
  std::vector<Dispersion> laws;  ///< Of each of these, unless the campaign file has another one.
  std::vector<ProgramQuantity> quantities;
  std::vector<std::string> streams;  ///< Of random numbers, each with a seed of its own in a run.
  std::size_t runs_at_once = 1;      ///< That it is asked for together.
  ProgramLimits limits;

  [[nodiscard]] LawSet law_set(std::span<const Dispersion> of) const {
    return {.names = drawn_names, .laws = of, .table = "drawn"};
  }
};

/// The name of a quantity, parameter or stream, as files and SQL can have it; empty if it is
/// refused.
/// @param path  Of what has it.
[[nodiscard]] std::string read_name(Document& document, const std::string& path);

/// @param answer  JSON that a program answered or a database holds: anything at all.
/// @param source  For messages: where it is from.
/// @throws DefinitionError naming source, field, value and rule, also of a key that is none.
[[nodiscard]] ProgramDescription description_in(std::string_view answer, const std::string& source);

}  // namespace proofmass::wire
