#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace proofmass {

/// Published errors |estimate − truth| of a quantity, SI.
struct PublishedAccuracy {
  double worst = 0.0;
  double mean = 0.0;
  double standard_deviation = 0.0;
};

/// A quantity that a model estimates in each run, and whose true value it knows.
struct Quantity {
  std::string_view name;          ///< In files, SQL and logs: `a_c11_delta_x`; [a-z0-9_]+.
  std::string_view unit_suffix;   ///< Unit as a name suffix: `_m`, `_rad`, `_s2_m` or empty.
  std::string_view symbol;        ///< For people: `a_c11·Δx`.
  std::string_view unit;          ///< For people, SI: `m`, `rad`, `s²/m` or `1`.
  double display_scale = 1.0;     ///< A table shows value / display_scale ...
  std::string_view display_unit;  ///< ... in this unit: `nm`, `1e-4 rad`.
  /// Largest acceptable |error|, SI, unless a campaign has another; infinite if there is none.
  double objective = std::numeric_limits<double>::infinity();
  std::optional<PublishedAccuracy> published = {};
  bool has_standard_error = false;  ///< True if estimates come with one.

  /// `a_c11_delta_x_m`, the end of the column names of this quantity.
  [[nodiscard]] std::string column() const { return std::string(name) + std::string(unit_suffix); }
};

/// A number that tells how well a run went, from 0 to magnitude_max; the larger, the worse.
struct HealthQuantity {
  std::string_view name;         ///< In files: `acceleration`.
  std::string_view unit_suffix;  ///< `_m_s2`, `_rad` or empty.
  std::string_view unit;         ///< `m/s²`, `rad` or `1`.

  [[nodiscard]] std::string column() const { return std::string(name) + std::string(unit_suffix); }
};

/// Data that all runs of a campaign share and that a database keeps as a table of its own.
struct DataTableSchema {
  std::string_view key;    ///< Of the definition, the one that names the file: `environment.file`.
  std::string_view table;  ///< In the database: `environment_row`.
  std::string_view comment;               ///< One line, for readers of the schema.
  std::vector<std::string_view> columns;  ///< With their units: `time_s`.
};

/// Says what the numbers of a model's results are. The order of the lists is that of the values in
/// a RunResult, of columns, exports and digests. Numbers that are stored count from 1, so that
/// lists may grow at their end and never otherwise.
struct ResultSchema {
  std::vector<Quantity> quantities;  ///< 1 to 63: a database keeps a bit for each.
  std::vector<HealthQuantity> health;
  std::vector<std::string_view> loss_causes;    ///< Why a run may be lost: `saturation`.
  std::vector<std::string_view> loss_sessions;  ///< In which part of it: `a_c12`.
  std::uint32_t num_draws_max = 1;              ///< Most draws of one run.
  std::vector<DataTableSchema> tables;
};

/// The name at a position from 1, as in Loss; `none` at 0.
[[nodiscard]] std::string_view name_at(const std::vector<std::string_view>& names,
                                       std::uint32_t position);

/// Index of the quantity of that name; nothing if there is none.
[[nodiscard]] std::optional<std::size_t> find_quantity(const ResultSchema& schema,
                                                       std::string_view name);

/// The names of all quantities, in their order.
[[nodiscard]] std::vector<std::string_view> quantity_names(const ResultSchema& schema);

}  // namespace proofmass
