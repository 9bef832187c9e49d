#include "coordinator/archive/detail/hdf5_file.hpp"

#include <fmt/format.h>

#include <string_view>

#include "coordinator/archive/archive_error.hpp"

namespace proofmass::coordinator::detail {
namespace {

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

}  // namespace

Hdf5Handle::Hdf5Handle(hid_t id, Close close, const std::filesystem::path& file)
    : id_(id), close_(close) {
  if (id_ < 0) fail(file);
}

Hdf5File::Hdf5File(const wire::DraftFile& file) : name_(file.path()) {
  // After a file that could not be flushed, the library's own end would crash; nothing is left
  // for it to do, as all files are closed here.
  (void)H5dont_atexit();
  // Errors are thrown, not printed.
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  // Nobody else knows the draft, and some file systems have no locks.
  const Hdf5Handle access = handle(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  check(H5Pset_file_locking(access, 0, 1));
  file_ = handle(H5Fcreate(file.draft().c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access), H5Fclose);
}

void Hdf5File::check(herr_t code) const {
  if (code < 0) fail(name_);
}

Hdf5Handle Hdf5File::make_group(const std::string& name) const {
  return handle(H5Gcreate2(file_, name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
}

void Hdf5File::set_text(hid_t object, const char* name, const std::string& text) const {
  const Hdf5Handle type = text_type();
  const char* const characters = text.c_str();
  set(object, name, type, type, scalar(), &characters);
}

void Hdf5File::set_texts(hid_t object, const char* name,
                         const std::vector<std::string>& texts) const {
  const Hdf5Handle type = text_type();
  std::vector<const char*> all;
  for (const std::string& text : texts) all.push_back(text.c_str());
  const hsize_t count = all.size();
  set(object, name, type, type, handle(H5Screate_simple(1, &count, nullptr), H5Sclose), all.data());
}

void Hdf5File::set_count(hid_t object, const char* name, std::uint64_t value) const {
  set(object, name, H5T_STD_U64LE, H5T_NATIVE_UINT64, scalar(), &value);
}

void Hdf5File::set_number(hid_t object, const char* name, double value) const {
  set(object, name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, scalar(), &value);
}

Hdf5Handle Hdf5File::text_type() const {
  Hdf5Handle type = handle(H5Tcopy(H5T_C_S1), H5Tclose);
  check(H5Tset_size(type, H5T_VARIABLE));
  check(H5Tset_cset(type, H5T_CSET_UTF8));
  return type;
}

void Hdf5File::set(hid_t object, const char* name, hid_t stored, hid_t given, Hdf5Handle space,
                   const void* value) const {
  const Hdf5Handle attribute =
      handle(H5Acreate2(object, name, stored, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  check(H5Awrite(attribute, given, value));
}

GrowingDataset::GrowingDataset(const Hdf5File& file, hid_t group, const std::string& name,
                               const DatasetFormat& format)
    : file_(&file), format_(format) {
  const hsize_t none = 0, unlimited = H5S_UNLIMITED;
  const Hdf5Handle space = file.handle(H5Screate_simple(1, &none, &unlimited), H5Sclose);
  const Hdf5Handle properties = file.handle(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  file.check(H5Pset_chunk(properties, 1, &format.chunk_rows));
  file.check(H5Pset_obj_track_times(properties, false));  // The same results are the same bytes.
  dataset_ = file.handle(
      H5Dcreate2(group, name.c_str(), format.stored, space, H5P_DEFAULT, properties, H5P_DEFAULT),
      H5Dclose);
}

void GrowingDataset::add(std::span<const std::byte> row) {
  rows_.insert(rows_.end(), row.begin(), row.end());
  if (++num_rows_ == format_.chunk_rows) flush();
}

void GrowingDataset::flush() {
  if (num_rows_ == 0) return;
  const hsize_t num_all = num_written_ + num_rows_;
  file_->check(H5Dset_extent(dataset_, &num_all));
  const Hdf5Handle memory = file_->handle(H5Screate_simple(1, &num_rows_, nullptr), H5Sclose);
  const Hdf5Handle space = file_->handle(H5Dget_space(dataset_), H5Sclose);
  file_->check(
      H5Sselect_hyperslab(space, H5S_SELECT_SET, &num_written_, nullptr, &num_rows_, nullptr));
  file_->check(H5Dwrite(dataset_, format_.given, memory, space, H5P_DEFAULT, rows_.data()));
  num_written_ = num_all;
  num_rows_ = 0;
  rows_.clear();
}

void describe_campaign(const Hdf5File& file, const Store& store) {
  file.set_text(file.root(), "name", store.name());
  file.set_count(file.root(), "seed", store.seed());
  file.set_count(file.root(), "num_runs", store.num_runs());
  file.set_text(file.root(), "model_version", store.model_version());
  file.set_text(file.root(), "build", store.build());
  file.set_text(file.root(), "definition", store.definition());
}

}  // namespace proofmass::coordinator::detail
