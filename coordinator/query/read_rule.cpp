#include "coordinator/query/read_rule.hpp"

#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

namespace proofmass::coordinator {
namespace {

// They tell something of the file and change nothing, whatever their argument.
constexpr std::array<std::string_view, 16> telling_pragmas{
    "collation_list",   "compile_options", "database_list", "foreign_key_check",
    "foreign_key_list", "function_list",   "index_info",    "index_list",
    "index_xinfo",      "integrity_check", "module_list",   "pragma_list",
    "quick_check",      "table_info",      "table_list",    "table_xinfo"};
// They tell something without an argument, and change it with one.
constexpr std::array<std::string_view, 8> pragmas_of_state{
    "application_id", "data_version", "encoding",       "freelist_count",
    "page_count",     "page_size",    "schema_version", "user_version"};
// The first loads machine code from a file, the second calls what an address points to.
constexpr std::array<std::string_view, 2> dangerous_functions{"load_extension", "fts3_tokenizer"};

template <typename Names>
bool contains(const Names& names, std::string_view name) {
  return std::ranges::find(names, name) != names.end();
}

std::string in_small_letters(std::string_view text) {
  std::string small(text);
  const auto lowered = [](unsigned char c) { return static_cast<char>(std::tolower(c)); };
  std::ranges::transform(small, small.begin(), lowered);
  return small;
}

bool is_harmless_pragma(std::string_view name, bool has_argument) {
  return contains(telling_pragmas, name) || (!has_argument && contains(pragmas_of_state, name));
}

}  // namespace

void ReadRule::apply_to(sqlite3* connection) {
  sqlite3_set_authorizer(connection, &ReadRule::on_action, this);
}

int ReadRule::on_action(void* rule, int action, const char* first, const char* second, const char*,
                        const char*) {
  const auto text = [](const char* argument) {
    return argument == nullptr ? std::string_view() : std::string_view(argument);
  };
  return static_cast<ReadRule*>(rule)->decide(action, text(first), text(second));
}

int ReadRule::decide(int action, std::string_view first, std::string_view second) {
  switch (action) {
    case SQLITE_SELECT:
    case SQLITE_READ:
    case SQLITE_RECURSIVE:
      return SQLITE_OK;
    case SQLITE_UPDATE:
      // SQLite asks so when a table-valued function is first named, and writes nothing. A statement
      // that would is known by sqlite3_stmt_readonly(), and the connection is read-only.
      if (first == "sqlite_master") return SQLITE_OK;
      return refuse("only reading is allowed");
    case SQLITE_FUNCTION:
      if (!contains(dangerous_functions, in_small_letters(second))) return SQLITE_OK;
      return refuse(fmt::format("the function {} is not allowed", second));
    case SQLITE_PRAGMA:
      if (is_harmless_pragma(in_small_letters(first), !second.empty())) return SQLITE_OK;
      return refuse(fmt::format("PRAGMA {} {}", first,
                                is_harmless_pragma(in_small_letters(first), false)
                                    ? "may be read, not set"
                                    : "is not allowed"));
    default:
      return refuse("only reading is allowed");
  }
}

int ReadRule::refuse(std::string reason) {
  if (refusal_.empty()) refusal_ = std::move(reason);
  return SQLITE_DENY;
}

}  // namespace proofmass::coordinator
