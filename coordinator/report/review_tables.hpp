#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/report/review.hpp"

namespace proofmass::coordinator {

/// The text of a cell, which may hold anything; documents escape it.
struct ReviewCell {
  std::string text;
  std::optional<double> value = {};  ///< In full precision and SI units, for programs.

  enum class Kind : std::uint8_t { figure, words, verdict };
  Kind kind = Kind::figure;
};

struct ReviewColumn {
  std::string title;
  std::string group = {};  ///< Heading above this column and its neighbours with the same one.
  bool is_text = false;    ///< Stands left.
};

/// A table of a review report. The first cell of a row is its heading.
struct ReviewTable {
  std::string id;  ///< Unique in a report; a-z, 0-9 and -.
  std::string caption;
  std::vector<ReviewColumn> columns;
  std::vector<std::vector<ReviewCell>> rows;
  std::vector<std::string> notes;  ///< Sentences below it.
};

/// A value of a quantity in its display unit, as a report spells it: `32.4 nm`, `11.6×10⁻⁴ rad`.
[[nodiscard]] std::string quantity_text(double value, const Quantity& quantity);

/// A name, or the symbol of the quantity that has it: sessions are called after what they are for.
[[nodiscard]] std::string name_in_symbols(std::string_view name);

/// True of a requirement that nobody stated: an objective of the campaign, or all together.
[[nodiscard]] bool is_default(const MatrixRow& row);

/// The id of a requirement; of an objective of the campaign, the symbol of its parameter.
[[nodiscard]] std::string requirement_name(const MatrixRow& row);

[[nodiscard]] ReviewTable matrix_table(const Review& review);

/// Worst, mean and standard deviation beside published figures.
[[nodiscard]] ReviewTable review_accuracy_table(const Review& review);

/// What the draws say about all draws: intervals, percentiles. No rows without an estimate.
[[nodiscard]] ReviewTable inference_table(const Review& review);

/// No rows if the campaign has no budget.
[[nodiscard]] ReviewTable review_budget_table(const Review& review);

/// The sums that explain the errors. No rows without causes.
[[nodiscard]] ReviewTable cause_table(const Review& review);

/// The lines that the estimates use, and the noise about them. No rows without spectra.
[[nodiscard]] ReviewTable spectrum_table(const RunSpectra& spectra);

/// What was run: identity, counts, digest.
[[nodiscard]] ReviewTable identity_table(const Review& review);

/// Workers, core hours, losses.
[[nodiscard]] ReviewTable execution_table(const Review& review);
[[nodiscard]] ReviewTable host_table(const Review& review);

/// The commands that repeat or check what the report shows, each with what it does.
[[nodiscard]] std::vector<std::pair<std::string, std::string>> reproducing_commands(
    const Review& review);

}  // namespace proofmass::coordinator
