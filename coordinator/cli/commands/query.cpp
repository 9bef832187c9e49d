#include "coordinator/query/query.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/cli/client.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/query/row_writer.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

constexpr double timeout_s_max = 86'400.0;
constexpr std::size_t table_rows_max = 1'000'000;
constexpr std::size_t table_columns_max = 100'000;

struct QueryOptions {
  std::filesystem::path database;
  std::vector<std::string> attached;  ///< `NAME=FILE`.
  std::string sql;                    ///< `-`: to be read from standard input.
  RowFormat format = RowFormat::table;
  double timeout_s = 60.0;
  std::size_t num_rows_max = 1000;         ///< Of a table.
  std::optional<std::size_t> num_columns;  ///< Of a table; those of the terminal by default.
  ClientConnectionConfig connection;       ///< Of a coordinator, if it is to be asked.
};

std::string read_standard_input() {
  std::string text;
  std::array<char, 4096> buffer{};
  while (const std::size_t size = std::fread(buffer.data(), 1, buffer.size(), stdin)) {
    text.append(buffer.data(), size);
    if (text.size() > sql_size_max) {
      throw UsageError(
          fmt::format("sql = - (standard input has more than {} bytes)", sql_size_max));
    }
  }
  if (std::ferror(stdin) != 0) {
    throw Error(fmt::format("standard input: {}", std::strerror(errno)));
  }
  return text;
}

/// A name in small letters that SQL takes without quotes and that SQLite has no other use for.
bool is_attachable(const std::string& name) {
  constexpr const char* allowed = "abcdefghijklmnopqrstuvwxyz0123456789_";
  return !name.empty() && name.size() <= 64 && (name[0] < '0' || name[0] > '9') &&
         name.find_first_not_of(allowed) == std::string::npos && name != "main" && name != "temp";
}

// `NAME=FILE`; the names differ, and letters in them have no case.
std::vector<AttachedFile> attached_files_of(const std::vector<std::string>& texts) {
  std::vector<AttachedFile> files;
  std::set<std::string> names;
  for (const std::string& text : texts) {
    const auto refuse = [&](std::string_view why) {
      throw UsageError(fmt::format("--attach {} ({})", text, why));
    };
    const std::size_t sign = text.find('=');
    if (sign == std::string::npos || sign + 1 == text.size()) refuse("must be NAME=FILE");
    AttachedFile file{.name = text.substr(0, sign), .file = text.substr(sign + 1)};
    std::string small = file.name;
    std::ranges::transform(small, small.begin(),
                           [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    if (!is_attachable(small)) {
      refuse(
          fmt::format("name = {} (must be 1 to 64 letters, digits and _, not begin with a digit, "
                      "and be neither main nor temp)",
                      file.name));
    }
    if (!names.insert(small).second) refuse("its name is attached already");
    files.push_back(std::move(file));
  }
  if (files.size() > attached_files_max) {
    throw UsageError(
        fmt::format("--attach = {} files (must be at most {})", files.size(), attached_files_max));
  }
  return files;
}

void require_not_swapped(const QueryOptions& options) {
  std::error_code ignored;
  if (std::filesystem::exists(options.database, ignored) || !has_campaign_mark(options.sql)) return;
  throw UsageError(
      fmt::format("SQL = {} (is a database: the database goes before the question)", options.sql));
}

const std::map<std::string, RowFormat>& formats() {
  static const std::map<std::string, RowFormat> formats{{"table", RowFormat::table},
                                                        {"csv", RowFormat::csv},
                                                        {"json", RowFormat::json},
                                                        {"markdown", RowFormat::markdown}};
  return formats;
}

/// Columns of a table; nothing if any number.
std::optional<std::size_t> table_columns(const QueryOptions& options) {
  if (options.num_columns || isatty(fileno(stdout)) == 0) return options.num_columns;
  return screen_size_of(stdout).columns;
}

int query_remotely(const QueryOptions& options) {
  if (!options.attached.empty()) {
    throw UsageError("--attach is not possible with --connect; fetch the databases first");
  }
  const auto format = std::ranges::find(formats(), options.format,
                                        &std::map<std::string, RowFormat>::value_type::second);
  proto::RequestEnvelope question = question_about(options.database, proto::QUESTION_QUERY);
  proto::AnswerRequest& asked = *question.mutable_answer();
  asked.add_options("--format=" + format->first);
  asked.add_options(fmt::format("--timeout={}", options.timeout_s));
  asked.add_options(fmt::format("--rows-max={}", options.num_rows_max));
  const std::optional<std::size_t> columns = table_columns(options);
  if (columns) asked.add_options(fmt::format("--columns={}", *columns));
  asked.set_statement(options.sql == "-" ? read_standard_input() : options.sql);
  const bool is_for_people = options.format == RowFormat::table;
  return print_answer(options.connection, question,
                      is_for_people ? print_lines : write_standard_output);
}

[[noreturn]] void end_process(const std::string& error) {
  if (error.empty()) _exit(exit_interrupted);
  wire::say(fmt::format("proofmass: error: {}\n", wire::visible_text(error)));
  _exit(exit_cannot_be_done);
}

// SIGINT and SIGTERM end it in order.
int query_database(const QueryOptions& options) {
  if (is_remote(options.connection, options.database)) return query_remotely(options);
  require_not_swapped(options);
  const QueryFiles files(options.database, attached_files_of(options.attached));
  // While it waits for input, a signal ends the process at once.
  const std::string sql = options.sql == "-" ? read_standard_input() : options.sql;
  const auto& stop = catch_stop_signals(OnTerminate::stop_now);
  const QueryLimits limits{.time_limit = std::chrono::duration<double>(options.timeout_s),
                           .is_interrupted = [&] { return stop != StopRequest::none; }};
  const TableLimits table{.num_rows_max = options.num_rows_max,
                          .num_columns = table_columns(options)};
  const QueryOutput output{.format = options.format,
                           .table = table,
                           .sink =
                               [](std::string_view rows) {
                                 write_standard_output(rows);
                                 flush_standard_output();
                               },
                           .end_process = end_process};
  const QueryEnd end = run_bounded_query(files, sql, limits, output);
  flush_standard_output();
  return end == QueryEnd::complete ? exit_done : exit_interrupted;
}

}  // namespace

void add_query(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<QueryOptions>(
      app, chosen, "query", "Ask a database a question in SQL", query_database);
  command.footer(exit_codes_text({exit_interrupted}));
  add_database(command, options.database);
  command.add_option("SQL", options.sql, "One statement that reads; - for standard input")
      ->required();
  command
      .add_option("--attach", options.attached,
                  "NAME=FILE: another campaign, whose tables are\n"
                  "NAME.run_result and so on; may be repeated")
      ->allow_extra_args(false);
  wire::add_choice(command, "--format", options.format, formats(), "table by default");
  add_number(command, "--timeout", options.timeout_s, {0.001, timeout_s_max},
             "Seconds that the answer may take");
  add_number(command, "--rows-max", options.num_rows_max, {1, table_rows_max},
             "Rows that a table shows");
  add_number(command, "--columns", options.num_columns, {20, table_columns_max},
             "Characters that a line of a table may take; by\ndefault as the terminal has, in "
             "a pipe any number");
  add_optional_connection(command, options.connection);
}

}  // namespace proofmass::coordinator
