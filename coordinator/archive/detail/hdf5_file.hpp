#pragma once

#include <hdf5.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/store/store.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator::detail {

// What is written with the library HDF5. Everything throws ArchiveError
// `output = path (cannot be written: why)` if the library fails.

/// Closes what the library opened.
class Hdf5Handle {
 public:
  using Close = herr_t (*)(hid_t);

  Hdf5Handle() = default;
  Hdf5Handle(hid_t id, Close close, const std::filesystem::path& file);
  ~Hdf5Handle() { reset(); }
  Hdf5Handle(Hdf5Handle&& other) noexcept
      : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Hdf5Handle& operator=(Hdf5Handle&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(close_, other.close_);
    return *this;
  }

  operator hid_t() const { return id_; }  // NOLINT: the library's functions take it everywhere.
  [[nodiscard]] hid_t release() { return std::exchange(id_, -1); }
  void reset() {
    if (id_ >= 0) close_(release());
  }

 private:
  hid_t id_ = -1;
  Close close_ = nullptr;
};

/// An HDF5 file that is written, by its draft.
class Hdf5File {
 public:
  explicit Hdf5File(const wire::DraftFile& file);

  [[nodiscard]] hid_t root() const { return file_; }

  void check(herr_t code) const;
  [[nodiscard]] Hdf5Handle handle(hid_t id, Hdf5Handle::Close closing) const {
    return {id, closing, name_};
  }
  [[nodiscard]] Hdf5Handle make_group(const std::string& name) const;

  // Attributes of a group or a dataset.
  void set_text(hid_t object, const char* name, const std::string& text) const;
  void set_texts(hid_t object, const char* name, const std::vector<std::string>& texts) const;
  void set_count(hid_t object, const char* name, std::uint64_t value) const;
  void set_number(hid_t object, const char* name, double value) const;

  /// Writes all that is in memory. @pre All handles are closed.
  void close() { check(H5Fclose(file_.release())); }

 private:
  [[nodiscard]] Hdf5Handle text_type() const;
  /// @param space  Scalar or of one dimension; closed afterwards.
  void set(hid_t object, const char* name, hid_t stored, hid_t given, Hdf5Handle space,
           const void* value) const;
  [[nodiscard]] Hdf5Handle scalar() const { return handle(H5Screate(H5S_SCALAR), H5Sclose); }

  std::filesystem::path name_;
  Hdf5Handle file_;
};

/// What the rows of a dataset are.
struct DatasetFormat {
  hid_t stored = -1;  ///< Type in the file.
  hid_t given = -1;   ///< Type in memory; lives as long as the dataset.
  hsize_t chunk_rows = 1;
};

/// A dataset of one dimension that grows at its end, a chunk at a time.
class GrowingDataset {
 public:
  GrowingDataset(const Hdf5File& file, hid_t group, const std::string& name,
                 const DatasetFormat& format);

  [[nodiscard]] hid_t id() const { return dataset_; }

  /// Adds a row of the type in memory. It is written when a chunk is full, or by flush().
  void add(std::span<const std::byte> row);
  template <typename Number>
  void add(const Number& number) {
    add(std::as_bytes(std::span(&number, 1)));
  }
  void flush();

 private:
  const Hdf5File* file_;
  DatasetFormat format_;
  Hdf5Handle dataset_;
  std::vector<std::byte> rows_;  ///< That wait.
  hsize_t num_rows_ = 0;         ///< Of them.
  hsize_t num_written_ = 0;
};

/// Attributes of the root that say which campaign a file is of.
void describe_campaign(const Hdf5File& file, const Store& store);

}  // namespace proofmass::coordinator::detail
