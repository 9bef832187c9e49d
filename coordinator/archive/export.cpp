#include "coordinator/archive/export.hpp"

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/archive/detail/hdf5_file.hpp"
#include "core/campaign/result_columns.hpp"
#include "core/model.hpp"

namespace proofmass::coordinator {
namespace {

using detail::describe_campaign;
using detail::GrowingDataset;
using detail::Hdf5File;
using detail::Hdf5Handle;

constexpr hsize_t chunk_rows = 2048;

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

/// All datasets of an export, with one number a run each.
class Columns {
 public:
  Columns(const Hdf5File& file, const ResultSchema& schema, std::shared_ptr<const Campaign> draws)
      : file_(file),
        value_columns_(value_columns(schema)),
        draws_(std::move(draws)),
        status_type_(status_type(file)),
        loss_cause_type_(position_type(file, schema.loss_causes)),
        loss_session_type_(position_type(file, schema.loss_sessions)) {
    make(file.root(), "run_index", H5T_STD_U64LE, H5T_NATIVE_UINT64);
    make(file.root(), "status", status_type_, status_type_);
    make(file.root(), "num_draws", H5T_STD_U32LE, H5T_NATIVE_UINT32);
    make(file.root(), "num_rounds", H5T_STD_U32LE, H5T_NATIVE_UINT32);
    make(file.root(), "loss_cause", loss_cause_type_, loss_cause_type_);
    make(file.root(), "loss_session", loss_session_type_, loss_session_type_);
    Hdf5Handle group;
    std::string_view group_name;
    for (const ValueColumn& column : value_columns_) {
      if (name_of(column.kind) != group_name) {
        group_name = name_of(column.kind);
        group = file.make_group(std::string(group_name));
      }
      make_value(group, column.own_name, column.unit);
    }
    if (draws_ == nullptr) return;
    group = file.make_group("draw");
    for (const DrawnQuantity& drawn : draws_->model().drawn()) {
      make_value(group, std::string(drawn.name), drawn.unit);
    }
  }

  void add(const RunResult& result) {
    auto column = columns_.begin();
    const auto put = [&](auto number) { (column++)->add(number); };
    put(result.run.value);
    put(static_cast<std::uint8_t>(result.status));
    put(result.num_draws);
    put(result.num_rounds);
    const bool is_lost = result.status == RunStatus::lost;
    put(static_cast<std::uint8_t>(result.loss.cause));
    put(is_lost ? static_cast<std::uint8_t>(result.loss.session) : std::uint8_t{0});
    for (const ValueColumn& value : value_columns_)
      put(value.value_in(result).value_or(no_meaning));
    if (draws_ == nullptr) return;
    const std::vector<double> drawn = draws_->draw(result.run).values;
    for (std::size_t i = 0; column != columns_.end(); ++i)
      put(drawn.empty() ? no_meaning : drawn[i]);
  }

  void flush() {
    for (GrowingDataset& column : columns_) column.flush();
  }

 private:
  static constexpr double no_meaning = std::numeric_limits<double>::quiet_NaN();

  /// @param stored  Type in the file, @param given of the numbers that are put.
  void make(hid_t group, const std::string& name, hid_t stored, hid_t given) {
    const detail::DatasetFormat format{.stored = stored, .given = given, .chunk_rows = chunk_rows};
    columns_.emplace_back(file_, group, name, format);
  }

  void make_value(hid_t group, const std::string& name, std::string_view unit) {
    make(group, name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE);
    file_.set_text(columns_.back().id(), "unit", std::string(unit));
  }

  const Hdf5File& file_;
  std::vector<ValueColumn> value_columns_;
  std::shared_ptr<const Campaign> draws_;  ///< Null without columns of drawn values.
  Hdf5Handle status_type_;
  Hdf5Handle loss_cause_type_;
  Hdf5Handle loss_session_type_;
  std::vector<GrowingDataset> columns_;
};

void write_results(const Hdf5File& file, const Store& store, const HeedStop& heed_stop,
                   DrawColumns draws) {
  const bool has_draws = draws == DrawColumns::included;
  Columns columns(file, store.schema(), has_draws ? store.campaign() : nullptr);
  const WalkedResults walked =
      walk_results(store, heed_stop, [&](const RunResult& result) { columns.add(result); });
  columns.flush();
  file.set_count(file.root(), "num_finished", walked.num_results);
  file.set_text(file.root(), "digest", walked.digest);
}

}  // namespace

void export_hdf5(const Store& store, const std::filesystem::path& file, const HeedStop& heed_stop,
                 DrawColumns draws) {
  wire::DraftFile draft("output", file);
  Hdf5File output(draft);
  store.read_one_state([&] {
    check_definition_digest(store);
    describe_campaign(output, store);
    write_results(output, store, heed_stop, draws);
  });
  output.close();
  draft.publish(wire::IfThere::replace);
}

std::function<void(const RunResult&)> stoppable(const HeedStop& heed_stop,
                                                std::function<void(const RunResult&)> visit) {
  return [&heed_stop, visit = std::move(visit),
          num_visits = std::uint64_t{0}](const RunResult& result) mutable {
    constexpr std::uint64_t visits_between_questions = 1024;
    if (num_visits++ % visits_between_questions == 0) heed_stop();
    visit(result);
  };
}

WalkedResults walk_results(const Store& store, const HeedStop& heed_stop,
                           const std::function<void(const RunResult&)>& visit) {
  return walk_checked(store, stoppable(heed_stop, visit));
}

void export_sqlite(const Store& store, const std::filesystem::path& file,
                   const HeedStop& heed_stop) {
  check_definition_digest(store);
  (void)walk_results(store, heed_stop, [](const RunResult&) {});
  wire::DraftFile draft("output", file);
  store.write_plain(draft.draft());
  draft.publish(wire::IfThere::replace);
}

}  // namespace proofmass::coordinator
