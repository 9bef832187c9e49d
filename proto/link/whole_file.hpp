#pragma once

#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>

namespace proofmass::wire {

/// A file descriptor, closed at the end of its owner's life.
class Descriptor {
 public:
  /// @param number  As open(2) returns it; negative: none.
  explicit Descriptor(int number = -1) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }
  Descriptor(Descriptor&& other) noexcept : number_(other.release()) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }

  [[nodiscard]] int number() const { return number_; }
  /// Leaves the descriptor open, and to the caller.
  [[nodiscard]] int release() { return std::exchange(number_, -1); }

 private:
  int number_;
};

/// A file without a name, in memory or on a disk: it is gone when its descriptor is closed.
class UnnamedFile {
 public:
  /// @param descriptor  As memfd_create(2) or open(2) return it.
  /// @throws Error with the reason in errno if it is negative.
  explicit UnnamedFile(int descriptor);

  [[nodiscard]] int descriptor() const { return descriptor_.number(); }
  [[nodiscard]] std::uint64_t size() const;  ///< Bytes.
  /// At most so many bytes from the offset on; fewer only at the end of the file.
  /// @throws Error if it cannot be read.
  [[nodiscard]] std::string read(std::uint64_t offset, std::size_t size_max) const;

 private:
  Descriptor descriptor_;
};

// Every file that the programs make. None is made or opened through a symbolic link, whoever put it
// there, and none has more permissions than the umask leaves.

/// What becomes of a file that has the name already.
enum class IfThere : std::uint8_t { keep, replace };

/// Permissions of a new file: a document, one that others may read, and one that they may not.
inline constexpr mode_t public_mode = 0666;
inline constexpr mode_t trusted_mode = 0644;
inline constexpr mode_t private_mode = 0600;

/// A file that appears under its name complete, or not at all: something writes it beside that
/// name, and publish() gives it the name. For what needs a path or does not fit into memory;
/// otherwise see write_whole_file().
class DraftFile {
 public:
  /// Makes the draft, an empty file. One that a killed process left there goes first.
  /// @param what    What the file is, for messages: `output`.
  /// @param path    Name that the file is to have.
  /// @param ending  What follows it in the name of the draft; by default no other process has it.
  /// @throws Error `what = PATH (cannot be written: reason)`.
  DraftFile(std::string_view what, std::filesystem::path path, mode_t mode = public_mode,
            std::string_view ending = {});
  ~DraftFile();  ///< Removes the draft unless it was published.
  DraftFile(const DraftFile&) = delete;
  DraftFile& operator=(const DraftFile&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] const std::filesystem::path& draft() const { return draft_; }

  /// Appends to the draft.
  /// @throws Error as the constructor does; so do all below.
  void write(std::string_view text) const;

  /// Makes the draft durable and gives it its name. A file that it replaces hands on its
  /// permissions. @pre The draft is closed.
  void publish(IfThere if_there);

  [[noreturn]] void fail(int error_number) const;

 private:
  std::string what_;
  std::filesystem::path path_;
  std::filesystem::path draft_;
  bool is_published_ = false;
};

/// Writes a file that is whole or not there at any time, also after a crash.
///
/// @param what  What the file is, for messages: `key file`.
/// @param mode  Permissions, less what the umask takes.
/// @throws Error `what = PATH (cannot be written: reason)`, also if others can read a file that is
///         to be private: some file systems keep no permissions.
void write_whole_file(std::string_view what, const std::filesystem::path& file,
                      std::string_view text, mode_t mode, IfThere if_there);

/// Makes a finished file durable and gives it its name, durably as far as the file system can.
/// @returns 0 or an errno; EEXIST if the name is to be kept and is taken.
[[nodiscard]] int publish_file(const std::filesystem::path& draft,
                               const std::filesystem::path& path, IfThere if_there);

/// Directory of a path; the working directory for a mere name.
[[nodiscard]] std::filesystem::path directory_of(const std::filesystem::path& path);

/// Makes the name of a file durable. @returns 0 or an errno.
[[nodiscard]] int synchronise_directory_of(const std::filesystem::path& path);

/// Whether a program's own file is made if it is not there.
enum class IfAbsent : std::uint8_t { make, leave };

/// Opens a file that the program keeps for itself, such as a lock, for reading and writing.
/// @param mode  Of a new one.
/// @return A descriptor, which the caller closes; -1 if the file is not there and is not made.
/// @throws Error `what = PATH (rule)` if it is a symbolic link, no regular file, another user's or
///         has a second name, or cannot be opened.
[[nodiscard]] int open_own_file(std::string_view what, const std::filesystem::path& file,
                                IfAbsent if_absent, mode_t mode = private_mode);

/// What came of an attempt to lock a file.
enum class Locked : std::uint8_t {
  yes,         ///< Until the descriptor is closed or the process ends, however it does.
  by_another,  ///< Another process has it.
  impossible,  ///< The file system has no locks; errno says so.
};

/// Locks a file for this process alone. Does not wait.
[[nodiscard]] Locked lock_file(int descriptor);

inline constexpr std::string_view no_locks_remedy =
    "is on a file system without locks; use a local disk";

/// Writes all of it. @returns False if that is impossible; errno says why.
[[nodiscard]] bool write_all(int descriptor, std::string_view text);

/// Whose a file must be that decides who may do what, and how far others may reach it.
enum class Reach : std::uint8_t {
  private_to_owner,  ///< This user's, and nobody else can read it.
  written_by_owner,  ///< This user's or root's, and nobody else can write it.
};

/// @throws Error `what = PATH (rule)`.
void check_reach(std::string_view what, const std::filesystem::path& file,
                 const struct stat& status, Reach reach);

/// The content of a file for which check_reach() holds.
/// @throws Error as check_reach() does, and if it cannot be read, is no regular file or has more
///         bytes.
[[nodiscard]] std::string read_within_reach(std::string_view what,
                                            const std::filesystem::path& file, Reach reach,
                                            std::size_t size_max);

}  // namespace proofmass::wire
