#include <fmt/format.h>
#include <hdf5.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/archive/export.hpp"
#include "coordinator/archive/result_columns.hpp"
#include "core/campaign/model.hpp"

namespace proofmass::coordinator {
namespace {

constexpr hsize_t chunk_rows = 2048;

// Called for each entry of the library's stack of errors, the first cause last.
herr_t keep_last(unsigned /*position*/, const H5E_error2_t* entry, void* text) {
  if (entry->desc != nullptr) *static_cast<std::string*>(text) = entry->desc;
  return 0;
}

// Of `file write failed: time = ..., error message = 'No space left on device', buf = ...` what
// people need; of other descriptions all.
std::string cause_in(const std::string& description) {
  constexpr std::string_view mark = "error message = '";
  const std::size_t found = description.find(mark);
  if (found == description.npos) return description;
  const std::size_t begin = found + mark.size();
  return description.substr(begin, description.find('\'', begin) - begin);
}

[[noreturn]] void fail(const std::filesystem::path& file) {
  std::string text = "HDF5 says nothing";
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_DOWNWARD, keep_last, &text);
  throw ArchiveError(
      fmt::format("output = {} (cannot be written: {})", file.string(), cause_in(text)));
}

/// Closes what the library opened.
class Handle {
 public:
  using Close = herr_t (*)(hid_t);

  Handle() = default;
  Handle(hid_t id, Close close, const std::filesystem::path& file) : id_(id), close_(close) {
    if (id_ < 0) fail(file);
  }
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(close_, other.close_);
    return *this;
  }

  operator hid_t() const { return id_; }  // NOLINT: the library's functions take it everywhere.
  /// Gives up what it holds.
  [[nodiscard]] hid_t release() { return std::exchange(id_, -1); }

 private:
  hid_t id_ = -1;
  Close close_ = nullptr;
};

/// An HDF5 file that is written, by its draft.
class Writer {
 public:
  explicit Writer(const DraftFile& file) : name_(file.path()) {
    // After a file that could not be flushed, the library's own end would crash; nothing is left
    // for it to do, as all files are closed here.
    (void)H5dont_atexit();
    // Errors are thrown, not printed.
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    file_ = Handle(H5Fcreate(file.draft().c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT),
                   H5Fclose, name_);
  }

  [[nodiscard]] hid_t root() const { return file_; }

  void check(herr_t code) const {
    if (code < 0) fail(name_);
  }
  [[nodiscard]] Handle handle(hid_t id, Handle::Close closing) const {
    return {id, closing, name_};
  }

  [[nodiscard]] Handle make_group(const std::string& name) const {
    return handle(H5Gcreate2(file_, name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  }

  void set_text(hid_t object, const char* name, const std::string& text) const {
    const Handle type = handle(H5Tcopy(H5T_C_S1), H5Tclose);
    check(H5Tset_size(type, H5T_VARIABLE));
    check(H5Tset_cset(type, H5T_CSET_UTF8));
    const char* const characters = text.c_str();
    set(object, name, type, type, &characters);
  }

  void set_count(hid_t object, const char* name, std::uint64_t value) const {
    set(object, name, H5T_STD_U64LE, H5T_NATIVE_UINT64, &value);
  }

  /// Writes all that is in memory.
  void close() { check(H5Fclose(file_.release())); }

 private:
  void set(hid_t object, const char* name, hid_t stored, hid_t given, const void* value) const {
    const Handle space = handle(H5Screate(H5S_SCALAR), H5Sclose);
    const Handle attribute =
        handle(H5Acreate2(object, name, stored, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    check(H5Awrite(attribute, given, value));
  }

  std::filesystem::path name_;
  Handle file_;
};

/// A dataset with one number a run, written a chunk at a time.
template <typename Number>
class Column {
 public:
  /// @param stored  Type in the file, @param given that of Number.
  Column(const Writer& writer, hid_t group, const std::string& name, hid_t stored, hid_t given)
      : writer_(&writer), given_(given) {
    const hsize_t none = 0, unlimited = H5S_UNLIMITED;
    const Handle space = writer.handle(H5Screate_simple(1, &none, &unlimited), H5Sclose);
    const Handle properties = writer.handle(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    writer.check(H5Pset_chunk(properties, 1, &chunk_rows));
    dataset_ = writer.handle(
        H5Dcreate2(group, name.c_str(), stored, space, H5P_DEFAULT, properties, H5P_DEFAULT),
        H5Dclose);
    rows_.reserve(chunk_rows);
  }

  [[nodiscard]] hid_t dataset() const { return dataset_; }

  void add(Number value) {
    rows_.push_back(value);
    if (rows_.size() == chunk_rows) flush();
  }

  void flush() {
    if (rows_.empty()) return;
    const hsize_t num_new = rows_.size();
    const hsize_t num_all = num_written_ + num_new;
    writer_->check(H5Dset_extent(dataset_, &num_all));
    const Handle memory = writer_->handle(H5Screate_simple(1, &num_new, nullptr), H5Sclose);
    const Handle space = writer_->handle(H5Dget_space(dataset_), H5Sclose);
    writer_->check(
        H5Sselect_hyperslab(space, H5S_SELECT_SET, &num_written_, nullptr, &num_new, nullptr));
    writer_->check(H5Dwrite(dataset_, given_, memory, space, H5P_DEFAULT, rows_.data()));
    num_written_ = num_all;
    rows_.clear();
  }

 private:
  const Writer* writer_;
  hid_t given_;
  Handle dataset_;
  std::vector<Number> rows_;
  hsize_t num_written_ = 0;
};

/// A type of the numbers [first, last] with the names that name_of() has for them.
template <typename Enumeration>
Handle enumeration_type(const Writer& writer, Enumeration first, Enumeration last) {
  Handle type = writer.handle(H5Tenum_create(H5T_STD_U8LE), H5Tclose);
  for (auto value = static_cast<std::uint8_t>(first); value <= static_cast<std::uint8_t>(last);
       ++value) {
    const std::string name(name_of(static_cast<Enumeration>(value)));
    writer.check(H5Tenum_insert(type, name.c_str(), &value));
  }
  return type;
}

/// Names of positions from 1; 0 is none.
Handle position_type(const Writer& writer, const std::vector<std::string_view>& names) {
  Handle type = writer.handle(H5Tenum_create(H5T_STD_U8LE), H5Tclose);
  for (std::uint8_t position = 0; position <= names.size(); ++position) {
    const std::string name(name_at(names, position));
    writer.check(H5Tenum_insert(type, name.c_str(), &position));
  }
  return type;
}

/// All datasets of an export.
class Columns {
 public:
  Columns(const Writer& writer, const DrawnColumns& draws)
      : draws_(draws),
        status_type_(enumeration_type(writer, RunStatus::completed, RunStatus::lost)),
        loss_cause_type_(position_type(writer, model().results().loss_causes)),
        loss_session_type_(position_type(writer, model().results().loss_sessions)),
        run_index_(writer, writer.root(), "run_index", H5T_STD_U64LE, H5T_NATIVE_UINT64),
        status_(writer, writer.root(), "status", status_type_, status_type_),
        num_draws_(writer, writer.root(), "num_draws", H5T_STD_U32LE, H5T_NATIVE_UINT32),
        num_rounds_(writer, writer.root(), "num_rounds", H5T_STD_U32LE, H5T_NATIVE_UINT32),
        loss_cause_(writer, writer.root(), "loss_cause", loss_cause_type_, loss_cause_type_),
        loss_session_(writer, writer.root(), "loss_session", loss_session_type_,
                      loss_session_type_) {
    Handle group;
    std::string_view group_name;
    for (const ValueColumn& column : value_columns()) {
      if (name_of(column.kind) != group_name) {
        group_name = name_of(column.kind);
        group = writer.make_group(std::string(group_name));
      }
      values_.emplace_back(writer, group, column.own_name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE);
      writer.set_text(values_.back().dataset(), "unit", std::string(column.unit));
    }
    add_draw_columns(writer);
  }

  void add(const RunResult& result) {
    run_index_.add(result.run.value);
    status_.add(static_cast<std::uint8_t>(result.status));
    num_draws_.add(result.num_draws);
    num_rounds_.add(result.num_rounds);
    const bool is_lost = result.status == RunStatus::lost;
    loss_cause_.add(static_cast<std::uint8_t>(result.loss.cause));
    loss_session_.add(is_lost ? static_cast<std::uint8_t>(result.loss.session) : std::uint8_t{0});
    for (std::size_t i = 0; i < value_columns().size(); ++i) {
      values_[i].add(value_columns()[i].value_in(result).value_or(no_meaning));
    }
    const std::vector<double> drawn = draws_.values_of(result.run);
    for (std::size_t i = 0; i < draws_.count(); ++i) {
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

  void add_draw_columns(const Writer& writer) {
    if (draws_.count() == 0) return;
    const Handle group = writer.make_group("draw");
    for (std::size_t i = 0; i < draws_.count(); ++i) {
      drawn_values_.emplace_back(writer, group, std::string(model().drawn()[i].name),
                                 H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE);
      writer.set_text(drawn_values_.back().dataset(), "unit", std::string(model().drawn()[i].unit));
    }
  }

  const DrawnColumns& draws_;
  Handle status_type_;
  Handle loss_cause_type_;
  Handle loss_session_type_;
  Column<std::uint64_t> run_index_;
  Column<std::uint8_t> status_;
  Column<std::uint32_t> num_draws_;
  Column<std::uint32_t> num_rounds_;
  Column<std::uint8_t> loss_cause_;
  Column<std::uint8_t> loss_session_;
  std::vector<Column<double>> values_;
  std::vector<Column<double>> drawn_values_;
};

void describe_campaign(const Writer& writer, const Store& store) {
  writer.set_text(writer.root(), "name", store.name());
  writer.set_count(writer.root(), "seed", store.seed());
  writer.set_count(writer.root(), "num_runs", store.num_runs());
  writer.set_text(writer.root(), "model_version", store.model_version());
  writer.set_text(writer.root(), "build", store.build());
  writer.set_text(writer.root(), "definition", store.definition());
}

void write_results(const Writer& writer, const Store& store, const IsStopped& is_stopped,
                   DrawColumns draws) {
  const DrawnColumns drawn(store, draws);
  Columns columns(writer, drawn);
  const WalkedResults walked =
      walk_results(store, is_stopped, [&](const RunResult& result) { columns.add(result); });
  columns.flush();
  writer.set_count(writer.root(), "num_finished", walked.num_results);
  writer.set_text(writer.root(), "digest", walked.digest);
}

}  // namespace

void export_hdf5(const Store& store, const std::filesystem::path& file, const IsStopped& is_stopped,
                 DrawColumns draws) {
  DraftFile draft(file, draft_ending());
  Writer writer(draft);
  store.read_one_state([&] {
    check_definition_digest(store);
    describe_campaign(writer, store);
    write_results(writer, store, is_stopped, draws);
  });
  writer.close();
  publish(draft);
}

}  // namespace proofmass::coordinator
