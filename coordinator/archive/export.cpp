#include "coordinator/archive/export.hpp"

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/archive/detail/hdf5_file.hpp"
#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/store/result_columns.hpp"
#include "core/model.hpp"

namespace proofmass::coordinator {
namespace {

using detail::describe_campaign;
using detail::GrowingDataset;
using detail::Hdf5File;
using detail::Hdf5Handle;

constexpr hsize_t chunk_rows = 2048;

/// A dataset with one number a run, written a chunk at a time.
template <typename Number>
class Column {
 public:
  /// @param stored  Type in the file, @param given that of Number.
  Column(const Hdf5File& file, hid_t group, const std::string& name, hid_t stored, hid_t given)
      : dataset_(file, group, name, {.stored = stored, .given = given, .chunk_rows = chunk_rows}) {
    rows_.reserve(chunk_rows);
  }

  [[nodiscard]] hid_t dataset() const { return dataset_.id(); }

  void add(Number value) {
    rows_.push_back(value);
    if (rows_.size() == chunk_rows) flush();
  }

  void flush() {
    dataset_.append(rows_.data(), rows_.size());
    rows_.clear();
  }

 private:
  GrowingDataset dataset_;
  std::vector<Number> rows_;
};

/// A type of the numbers from `first` on with these names.
Hdf5Handle enumeration_type(const Hdf5File& file, std::uint8_t first,
                            const std::vector<std::string_view>& names) {
  Hdf5Handle type = file.handle(H5Tenum_create(H5T_STD_U8LE), H5Tclose);
  for (const std::string_view name : names) {
    file.check(H5Tenum_insert(type, std::string(name).c_str(), &first));
    ++first;
  }
  return type;
}

Hdf5Handle status_type(const Hdf5File& file) {
  std::vector<std::string_view> names;
  constexpr auto first = static_cast<std::uint8_t>(RunStatus::completed);
  for (std::uint8_t value = first; value <= static_cast<std::uint8_t>(RunStatus::lost); ++value) {
    names.push_back(name_of(static_cast<RunStatus>(value)));
  }
  return enumeration_type(file, first, names);
}

/// Names of positions from 1; 0 is none.
Hdf5Handle position_type(const Hdf5File& file, std::vector<std::string_view> names) {
  names.insert(names.begin(), name_at(names, 0));
  return enumeration_type(file, 0, names);
}

/// All datasets of an export.
class Columns {
 public:
  Columns(const Hdf5File& file, const ResultSchema& schema, std::shared_ptr<const Campaign> draws)
      : value_columns_(value_columns(schema)),
        draws_(std::move(draws)),
        status_type_(status_type(file)),
        loss_cause_type_(position_type(file, schema.loss_causes)),
        loss_session_type_(position_type(file, schema.loss_sessions)),
        run_index_(file, file.root(), "run_index", H5T_STD_U64LE, H5T_NATIVE_UINT64),
        status_(file, file.root(), "status", status_type_, status_type_),
        num_draws_(file, file.root(), "num_draws", H5T_STD_U32LE, H5T_NATIVE_UINT32),
        num_rounds_(file, file.root(), "num_rounds", H5T_STD_U32LE, H5T_NATIVE_UINT32),
        loss_cause_(file, file.root(), "loss_cause", loss_cause_type_, loss_cause_type_),
        loss_session_(file, file.root(), "loss_session", loss_session_type_, loss_session_type_) {
    Hdf5Handle group;
    std::string_view group_name;
    for (const ValueColumn& column : value_columns_) {
      if (name_of(column.kind) != group_name) {
        group_name = name_of(column.kind);
        group = file.make_group(std::string(group_name));
      }
      values_.emplace_back(file, group, column.own_name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE);
      file.set_text(values_.back().dataset(), "unit", std::string(column.unit));
    }
    if (draws_ != nullptr) add_draw_columns(file);
  }

  void add(const RunResult& result) {
    run_index_.add(result.run.value);
    status_.add(static_cast<std::uint8_t>(result.status));
    num_draws_.add(result.num_draws);
    num_rounds_.add(result.num_rounds);
    const bool is_lost = result.status == RunStatus::lost;
    loss_cause_.add(static_cast<std::uint8_t>(result.loss.cause));
    loss_session_.add(is_lost ? static_cast<std::uint8_t>(result.loss.session) : std::uint8_t{0});
    for (std::size_t i = 0; i < values_.size(); ++i) {
      values_[i].add(value_columns_[i].value_in(result).value_or(no_meaning));
    }
    if (draws_ == nullptr) return;
    const std::vector<double> drawn = draws_->draw(result.run).values;
    for (std::size_t i = 0; i < drawn_values_.size(); ++i) {
      drawn_values_[i].add(drawn.empty() ? no_meaning : drawn[i]);
    }
  }

  void flush() {
    run_index_.flush();
    status_.flush();
    num_draws_.flush();
    num_rounds_.flush();
    loss_cause_.flush();
    loss_session_.flush();
    for (Column<double>& column : values_) column.flush();
    for (Column<double>& column : drawn_values_) column.flush();
  }

 private:
  static constexpr double no_meaning = std::numeric_limits<double>::quiet_NaN();

  void add_draw_columns(const Hdf5File& file) {
    const Hdf5Handle group = file.make_group("draw");
    for (const DrawnQuantity& drawn : draws_->model().drawn()) {
      drawn_values_.emplace_back(file, group, std::string(drawn.name), H5T_IEEE_F64LE,
                                 H5T_NATIVE_DOUBLE);
      file.set_text(drawn_values_.back().dataset(), "unit", std::string(drawn.unit));
    }
  }

  std::vector<ValueColumn> value_columns_;
  std::shared_ptr<const Campaign> draws_;  ///< Null without columns of drawn values.
  Hdf5Handle status_type_;
  Hdf5Handle loss_cause_type_;
  Hdf5Handle loss_session_type_;
  Column<std::uint64_t> run_index_;
  Column<std::uint8_t> status_;
  Column<std::uint32_t> num_draws_;
  Column<std::uint32_t> num_rounds_;
  Column<std::uint8_t> loss_cause_;
  Column<std::uint8_t> loss_session_;
  std::vector<Column<double>> values_;
  std::vector<Column<double>> drawn_values_;
};

void write_results(const Hdf5File& file, const Store& store, const IsStopped& is_stopped,
                   DrawColumns draws) {
  const bool has_draws = draws == DrawColumns::included;
  Columns columns(file, store.schema(), has_draws ? stored_campaign_unchecked(store) : nullptr);
  const WalkedResults walked =
      walk_results(store, is_stopped, [&](const RunResult& result) { columns.add(result); });
  columns.flush();
  file.set_count(file.root(), "num_finished", walked.num_results);
  file.set_text(file.root(), "digest", walked.digest);
}

}  // namespace

void export_hdf5(const Store& store, const std::filesystem::path& file, const IsStopped& is_stopped,
                 DrawColumns draws) {
  wire::DraftFile draft("output", file);
  Hdf5File output(draft);
  store.read_one_state([&] {
    check_definition_digest(store);
    describe_campaign(output, store);
    write_results(output, store, is_stopped, draws);
  });
  output.close();
  draft.publish(wire::IfThere::replace);
}

WalkedResults walk_results(const Store& store, const IsStopped& is_stopped,
                           const std::function<void(const RunResult&)>& visit) {
  constexpr std::uint64_t visits_between_questions = 1024;
  std::uint64_t num_visits = 0;
  return walk_checked(store, [&](const RunResult& result) {
    if (num_visits++ % visits_between_questions == 0 && is_stopped()) throw Interrupted();
    visit(result);
  });
}

void export_sqlite(const Store& store, const std::filesystem::path& file,
                   const IsStopped& is_stopped) {
  check_definition_digest(store);
  (void)walk_results(store, is_stopped, [](const RunResult&) {});
  wire::DraftFile draft("output", file);
  store.write_plain(draft.draft());
  draft.publish(wire::IfThere::replace);
}

}  // namespace proofmass::coordinator
