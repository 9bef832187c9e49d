#include "tests/tidy/rules.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <span>

namespace proofmass::test {
namespace {

constexpr std::size_t num_columns_max = 100;
constexpr std::size_t num_lines_max = 500;
constexpr std::size_t num_function_lines_max = 70;

std::string finding(const SourceFile& file, std::size_t line, std::string_view what) {
  return fmt::format("{}:{}: {}", file.path, line, what);
}

bool matches(const std::string& text, const char* pattern) {
  return std::regex_search(text, std::regex(pattern));
}

// The parts of core, and those of the model in core/microscope: each may include those before it.
// A part is a folder, or the files of that name beside the folders.
constexpr std::array<std::string_view, 12> core_order{
    "error",    "runs",       "math",  "random",       "signal",         "statistics",
    "campaign", "definition", "model", "result_rules", "settings_model", "microscope"};
constexpr std::array<std::string_view, 13> microscope_order{
    "orbit",    "environment",      "session",       "results",    "instrument",
    "control",  "estimation",       "campaign",      "simulation", "definition",
    "planning", "microscope_model", "built_in_model"};

// `signal` for `core/signal/window.hpp` in `core`, empty for what is not in the folder.
std::string part_of(const std::string& path, std::string_view folder) {
  if (!path.starts_with(std::string(folder) + "/")) return "";
  const std::size_t begin = folder.size() + 1;
  return path.substr(begin, path.find_first_of("/.", begin) - begin);
}

// What is wrong with an include between two parts of a folder; empty if it is admissible.
std::string broken_order(const SourceFile& file, const std::string& include,
                         std::string_view folder, std::span<const std::string_view> order) {
  const std::string from = part_of(file.path, folder);
  const std::string to = part_of(include, folder);
  if (from.empty() || to.empty() || from == to) return "";
  for (const std::string& part : {from, to}) {
    if (std::ranges::find(order, part) != order.end()) continue;
    return fmt::format("{} has no place in the order of {} (tests/tidy/rules.cpp)", part, folder);
  }
  if (std::ranges::find(order, to) < std::ranges::find(order, from)) return "";
  return fmt::format("{} comes before {} in the order of {}", from, to, folder);
}

// What would tie the engine to one model, or the parts of core to each other; empty if admissible.
std::string broken_seam(const SourceFile& file, const std::string& include) {
  const bool is_of_model = file.is_in("core/microscope");
  if (matches(include, "^core/microscope/") && !is_of_model) {
    return "what runs campaigns knows core/model.hpp, not one model";
  }
  const bool may_read_text =
      matches(file.path, "^core/microscope/(definition/|microscope_model\\.cpp$)");
  if (is_of_model && !may_read_text && matches(include, "^core/definition/")) {
    return "numerics depend on no text: of a model, its definition alone reads and writes it";
  }
  const std::string broken = broken_order(file, include, "core", core_order);
  if (!broken.empty()) return broken;
  return broken_order(file, include, "core/microscope", microscope_order);
}

// Whether the other rules can see what an include means; empty if they can.
std::string badly_written(const std::string& include, bool is_quoted) {
  const std::filesystem::path path = include;
  const bool is_plain = path.is_relative() && path.lexically_normal().generic_string() == include &&
                        !include.starts_with("..");
  if (is_plain && (!is_quoted || matches(include, "^(core|proto|coordinator|worker|tests)/"))) {
    return "";
  }
  return "an include of the project is written from its root, without . and ..";
}

// What a file must not include, by layer; empty if the include is admissible.
std::string broken_layer(const SourceFile& file, const std::string& include) {
  const bool is_source = file.path.ends_with(".cpp");
  if (matches(include, "^sqlite3(ext)?\\.h") &&
      !(matches(file.path, "^coordinator/(store|query)/") &&
        (is_source || file.path.ends_with("-inl.hpp")))) {
    return "SQLite stays in *.cpp and *-inl.hpp of coordinator/store and coordinator/query";
  }
  if (matches(include, "^zmq") &&
      !(matches(file.path, "^(coordinator/net|worker/net|proto/link)/") && is_source)) {
    return "ZeroMQ stays in */net/*.cpp and proto/link/*.cpp";
  }
  if (matches(include, "^boost/(asio|beast)") && file.path != "coordinator/page/http_server.cpp") {
    return "HTTP stays in coordinator/page/http_server.cpp";
  }
  if (matches(include, "^boost/math") && file.path != "core/statistics/distribution.cpp") {
    return "laws whose last bits depend on the processor stay in core/statistics/distribution.cpp";
  }
  if (matches(include, "^boost/random") && file.path != "core/random/sobol.cpp") {
    return "Boost.Random has direction numbers for core/random/sobol.cpp, and draws nothing";
  }
  if (matches(include, "^google/protobuf") && !(file.is_in("proto/wire") && is_source)) {
    return "what Protobuf itself offers stays in proto/wire/*.cpp";
  }
  if (matches(include, "\\.pb\\.h$|^proto/wire/client_codec\\.hpp$") &&
      !matches(file.path,
               "^(proto/wire/|coordinator/(cli|factory|net)/|coordinator/report/status_|"
               "coordinator/store/campaign_record|worker/|tests/)") &&
      !(file.is_in("coordinator/dispatch") && is_source)) {
    return "messages stay in proto/wire, coordinator/cli, coordinator/dispatch/*.cpp, "
           "coordinator/factory, coordinator/net, coordinator/report/status_*, "
           "coordinator/store/campaign_record.* and worker";
  }
  if (matches(include, "^toml") &&
      !matches(file.path,
               "^(core/definition|core/microscope/definition|coordinator/campaign_file)/")) {
    return "TOML stays in core/definition, core/microscope/definition and "
           "coordinator/campaign_file";
  }
  if (const std::string broken = broken_seam(file, include); !broken.empty()) return broken;
  if (file.is_in("core") && matches(include, "^(proto|coordinator|worker|tests)/")) {
    return "core depends on nothing above it";
  }
  if (file.is_in("core") &&
      matches(include,
              "^(spdlog/|chrono$|thread$|mutex$|future$|fstream$|iostream$|filesystem$|"
              "random$|ctime$|unistd\\.h|sys/)")) {
    return "core has no clock, thread, file, logger or random device";
  }
  if (file.is_in("proto") && matches(include, "^(coordinator|worker|tests)/")) {
    return "proto depends on core alone";
  }
  if (file.is_in("coordinator") && matches(include, "^(worker|tests)/")) {
    return "coordinator never sees worker";
  }
  if (file.is_in("worker") && matches(include, "^(coordinator|tests)/")) {
    return "worker never sees coordinator";
  }
  return "";
}

std::size_t line_at(std::string_view text, std::size_t position) {
  return static_cast<std::size_t>(std::ranges::count(text.substr(0, position), '\n')) + 1;
}

bool is_name_part(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }

// Text without what stands in parentheses, blanks joined: `int f() const` for `int f(int a) const`.
std::string outline_of(std::string_view text) {
  std::string outline;
  int depth = 0;
  for (const char c : text) {
    if (c == ')') --depth;
    const bool is_blank = std::isspace(static_cast<unsigned char>(c)) != 0;
    const bool follows_blank = !outline.empty() && outline.back() == ' ';
    if (depth == 0 && !(is_blank && follows_blank)) outline += is_blank ? ' ' : c;
    if (c == '(') ++depth;
  }
  return outline;
}

// True if the text in front of an opening brace is the head of a function.
bool is_function_head(std::string_view head) {
  static const std::regex scope("^ ?(namespace|class|struct|union|enum|extern)\\b");
  static const std::regex function("\\)( (const|noexcept|override|final|->[^=]*|:.*))* ?$");
  const std::string outline = outline_of(head);
  const bool is_value = outline.find(" = ") != std::string::npos;
  return !is_value && !std::regex_search(outline, scope) && std::regex_search(outline, function);
}

// Position of the brace that closes the one at `open`.
std::size_t closing_brace(std::string_view code, std::size_t open) {
  std::size_t depth = 0;
  for (std::size_t i = open; i < code.size(); ++i) {
    if (code[i] == '{') ++depth;
    if (code[i] == '}' && --depth == 0) return i;
  }
  return code.size();
}

// Words of an identifier, small letters: `numTaskSlots` and `num_task_slots` have num, task, slots.
std::vector<std::string> words_of(const std::string& identifier) {
  std::vector<std::string> words(1);
  for (const char c : identifier) {
    const bool starts_word = c == '_' || std::isupper(static_cast<unsigned char>(c)) != 0;
    if (starts_word && !words.back().empty()) words.emplace_back();
    if (c != '_') words.back() += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return words;
}

bool is_banned(std::string word) {
  static const std::set<std::string> banned{"job",   "task",   "node",    "master", "slave",
                                            "trial", "helper", "manager", "utils",  "misc"};
  if (banned.contains(word)) return true;
  if (word.ends_with('s')) word.pop_back();
  return banned.contains(word);
}

}  // namespace

Findings check_layers(const SourceFile& file) {
  Findings findings;
  if (!file.is_cpp()) return findings;
  static const std::regex directive("^\\s*#\\s*include\\b");
  static const std::regex pattern("^\\s*#\\s*include\\s*([<\"])([^>\"]+)[>\"]");
  const std::vector<std::string> lines = lines_of(file.text);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (!std::regex_search(lines[i], directive)) continue;
    std::smatch match;
    if (!std::regex_search(lines[i], match, pattern)) {
      findings.push_back(finding(file, i + 1, "an include names its file"));
      continue;
    }
    const std::string include = match[2];
    // A project outside the tree, as those below deploy/ are, is a root of its own.
    const bool has_our_root = match[1] == "\"" && !file.is_in("deploy");
    std::string what = badly_written(include, has_our_root);
    if (what.empty() && !file.is_in("tests")) what = broken_layer(file, include);
    if (!what.empty()) findings.push_back(finding(file, i + 1, include + ": " + what));
  }
  return findings;
}

Findings check_links(const SourceFile& file) {
  // Programs, and the module that SQLite loads: each is linked with one model.
  static const std::set<std::string> programs{"coordinator/cli/CMakeLists.txt proofmass",
                                              "coordinator/cli/CMakeLists.txt ${program}",
                                              "coordinator/query/CMakeLists.txt proofmass_sqlite",
                                              "worker/CMakeLists.txt proofmass-worker"};
  static const std::regex library("proofmass(::|_)(microscope\\w*)");
  Findings findings;
  const bool may_know_a_model = file.is_in("core/microscope") || file.is_in("tests");
  if (!file.path.ends_with("CMakeLists.txt") || may_know_a_model) return findings;
  const std::string code = std::regex_replace(file.text, std::regex("#[^\n]*"), "");
  for (std::sregex_iterator it(code.begin(), code.end(), library), end; it != end; ++it) {
    const auto position = static_cast<std::size_t>(it->position());
    const std::size_t open = code.rfind('(', position) + 1;  // Of the command.
    const std::string target = code.substr(open, code.find_first_of(" \n)", open) - open);
    if (programs.contains(file.path + " " + target)) continue;
    findings.push_back(finding(
        file, line_at(code, position),
        fmt::format("{}: only a program is linked with a model, not {}", it->str(), target)));
  }
  return findings;
}

Findings check_header_guard(const SourceFile& file) {
  if (!file.is_header() || file.text.starts_with("#pragma once\n")) return {};
  return {finding(file, 1, "must begin with #pragma once")};
}

Findings check_size(const SourceFile& file) {
  Findings findings;
  if (file.path.ends_with("CMakeLists.txt")) return findings;
  const std::vector<std::string> lines = lines_of(file.text);
  if (lines.size() > num_lines_max) {
    findings.push_back(
        finding(file, lines.size(), fmt::format("more than {} lines", num_lines_max)));
  }
  for (std::size_t i = 0; i < lines.size(); ++i) {
    // Bytes that continue a UTF-8 character take no column.
    const auto num_columns = std::ranges::count_if(
        lines[i], [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; });
    if (static_cast<std::size_t>(num_columns) <= num_columns_max) continue;
    findings.push_back(finding(file, i + 1, fmt::format("{} columns", num_columns)));
  }
  return findings;
}

Findings check_function_length(const SourceFile& file) {
  Findings findings;
  if (!file.is_cpp()) return findings;
  // Preprocessor lines have no braces that count, and would glue themselves to a head.
  const std::string code =
      std::regex_replace(code_of(file.text), std::regex("(^|\n)[ \t]*#[^\n]*"), "$1");
  std::size_t head = 0;
  for (std::size_t i = 0; i < code.size(); ++i) {
    if (code[i] == ';' || code[i] == '}') head = i + 1;
    if (code[i] != '{') continue;
    // A brace right behind a name holds the value of a member.
    if (i > 0 && is_name_part(code[i - 1])) {
      i = std::min(closing_brace(code, i), code.size() - 1);
      continue;
    }
    if (is_function_head(std::string_view(code).substr(head, i - head))) {
      const std::size_t close = closing_brace(code, i);
      const std::size_t num_lines = line_at(code, close) - line_at(code, i) + 1;
      if (num_lines > num_function_lines_max) {
        findings.push_back(
            finding(file, line_at(code, i), fmt::format("function of {} lines", num_lines)));
      }
      i = std::min(close, code.size() - 1);
    }
    head = i + 1;
  }
  return findings;
}

Findings check_open_work(const SourceFile& file) {
  Findings findings;
  // Spelled apart, so that this file keeps its own rule.
  static const std::regex marks(
      "\\b(TO"
      "DO|FIX"
      "ME|X"
      "XX)\\b");
  static const std::regex with_issue(
      "\\bTO"
      "DO\\(#[0-9]+\\):");
  const std::vector<std::string> lines = lines_of(file.text);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (!std::regex_search(lines[i], marks) || std::regex_search(lines[i], with_issue)) continue;
    findings.push_back(finding(file, i + 1, "open work without an issue"));
  }
  return findings;
}

Findings check_elementary_functions(const SourceFile& file) {
  Findings findings;
  if (!file.is_cpp() || !file.is_in("core")) return findings;
  static const std::regex call(
      "(^|[^\\w.>:]|std::|(^|[^\\w])::)((sin|cos|tan|asin|acos|atan|atan2|sinh|cosh|tanh|exp|exp2|"
      "expm1|log|log2|log10|log1p|pow|cbrt|hypot|erf|erfc|tgamma|lgamma|polar)f?)\\s*\\(");
  const std::vector<std::string> lines = lines_of(code_of(file.text));
  for (std::size_t i = 0; i < lines.size(); ++i) {
    std::smatch match;
    if (!std::regex_search(lines[i], match, call)) continue;
    findings.push_back(finding(file, i + 1, match[3].str() + " (use core/math/elementary.hpp)"));
  }
  return findings;
}

Findings check_words(const SourceFile& file) {
  Findings findings;
  if (!file.is_cpp() && !file.path.ends_with(".proto")) return findings;
  // Names that libraries chose.
  static const std::regex foreign("toml::node\\b|\\)\\.node\\(\\)");
  static const std::regex identifier("[A-Za-z_]\\w*");
  const std::vector<std::string> lines = lines_of(code_of(file.text));
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::string line = std::regex_replace(lines[i], foreign, "");
    for (std::sregex_iterator it(line.begin(), line.end(), identifier), end; it != end; ++it) {
      const std::string name = it->str();
      if (!std::ranges::any_of(words_of(name), is_banned)) continue;
      findings.push_back(finding(file, i + 1, name + " is not one of our words"));
    }
  }
  return findings;
}

Findings check_all_built(const std::vector<SourceFile>& files) {
  namespace fs = std::filesystem;
  std::map<std::string, std::set<std::string>> listed;  // Words of each folder's CMakeLists.txt.
  for (const SourceFile& file : files) {
    if (fs::path(file.path).filename() != "CMakeLists.txt") continue;
    static const std::regex word("[\\w./-]+");
    auto& words = listed[fs::path(file.path).parent_path().generic_string()];
    for (std::sregex_iterator it(file.text.begin(), file.text.end(), word), end; it != end; ++it) {
      words.insert(it->str());
    }
  }
  const auto is_listed = [&](const fs::path& path) {
    for (fs::path folder = path.parent_path();; folder = folder.parent_path()) {
      const auto words = listed.find(folder.generic_string());
      const std::string name =
          path.lexically_relative(folder.empty() ? "." : folder).generic_string();
      if (words != listed.end() && words->second.contains(name)) return true;
      if (folder.empty()) return false;
    }
  };
  Findings findings;
  for (const SourceFile& file : files) {
    if (!file.path.ends_with(".cpp") || is_listed(file.path)) continue;
    findings.push_back(finding(file, 1, "in no CMakeLists.txt"));
  }
  return findings;
}

Findings check_types_unique(const std::vector<SourceFile>& files) {
  static const std::regex opening("^namespace ([\\w:]+) \\{$");
  static const std::regex type("^(?:class|struct|enum class) (\\w+)[^;]*\\{");
  std::map<std::string, std::string> first_of;  // The header of each `namespace::type`.
  Findings findings;
  for (const SourceFile& file : files) {
    if (!file.is_header() || file.is_in("tests")) continue;
    std::string scope;
    std::size_t line_number = 0;
    for (const std::string& line : lines_of(code_of(file.text))) {
      ++line_number;
      std::smatch match;
      if (std::regex_search(line, match, opening)) scope = match[1];
      if (!std::regex_search(line, match, type)) continue;
      const auto [entry, is_new] = first_of.emplace(scope + "::" + match[1].str(), file.path);
      if (is_new) continue;
      findings.push_back(finding(file, line_number, entry->first + " is also in " + entry->second));
    }
  }
  return findings;
}

}  // namespace proofmass::test
