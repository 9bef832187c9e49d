#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "coordinator/query/query.hpp"
#include "coordinator/store/detail/database.hpp"

namespace proofmass::coordinator {

/// A connection to campaign databases that cannot write to them; each is checked first. Of a file
/// of an older version it has a private copy, brought up to date.
/// @throws StoreError if a file is no campaign database or cannot be read.
[[nodiscard]] std::unique_ptr<detail::Database> open_files(const QueryFiles& files);

/// Lets the statements of a connection read and do nothing else: no change, no other file, no
/// function or PRAGMA that is not harmless.
class ReadRule {
 public:
  /// The rule must outlive the connection.
  void apply_to(sqlite3* connection);

  /// The first thing that was refused, for people; empty if nothing was.
  [[nodiscard]] const std::string& refusal() const { return refusal_; }

 private:
  static int on_action(void* rule, int action, const char* first, const char* second, const char*,
                       const char*);
  int decide(int action, std::string_view first, std::string_view second);
  int refuse(std::string reason);

  std::string refusal_;
};

}  // namespace proofmass::coordinator
