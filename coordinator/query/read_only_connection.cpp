#include "coordinator/query/read_only_connection.hpp"

#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

#include "coordinator/store/detail/store_impl.hpp"

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

void check_attached_name(std::string_view name) {
  const auto is_letter = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
  };
  const auto is_allowed = [&](char c) { return is_letter(c) || (c >= '0' && c <= '9'); };
  const bool is_name = !name.empty() && name.size() <= 64 && is_letter(name[0]) &&
                       std::ranges::all_of(name, is_allowed);
  const std::string text(name);
  const bool is_taken =
      sqlite3_stricmp(text.c_str(), "main") == 0 || sqlite3_stricmp(text.c_str(), "temp") == 0;
  if (is_name && !is_taken) return;
  throw InvalidArgument(fmt::format(
      "name = {} (must be 1 to 64 letters, digits and _, not begin with a digit, and be neither "
      "main nor temp)",
      name));
}

std::unique_ptr<detail::Database> open_files(const QueryFiles& files) {
  PROOFMASS_EXPECT(files.attached.size() <= attached_files_max);
  detail::check_presence(files.main);
  auto database = std::make_unique<detail::Database>(files.main, detail::Access::read_only);
  (void)detail::prepare_reader(*database, files.main);
  for (const auto& [name, file] : files.attached) {
    detail::check_presence(file);
    detail::Database other(file, detail::Access::read_only);
    (void)detail::prepare_reader(other, file);
    database->attach(other, name);
  }
  // A private copy has it on: the caller has tables of its own to add before it is turned on again.
  database->execute("PRAGMA query_only = OFF");
  return database;
}

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
