#include "proto/link/log.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstddef>
#include <memory>
#include <nlohmann/json.hpp>

#include "proto/text/visible_text.hpp"

namespace proofmass::wire {
namespace {

// Messages quote files and peers: what they say must neither steer a terminal nor look like a line
// of its own. All messages pass through one of the two formatters.
std::string visible_payload(const spdlog::details::log_msg& message) {
  return visible_text({message.payload.data(), message.payload.size()});
}

class TextFormatter final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& line) override {
    const std::string payload = visible_payload(message);
    spdlog::details::log_msg visible = message;
    visible.payload = payload;
    pattern_.format(visible, line);
  }
  [[nodiscard]] std::unique_ptr<formatter> clone() const override {
    return std::make_unique<TextFormatter>();
  }

 private:
  spdlog::pattern_formatter pattern_;
};

class JsonFormatter final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& line) override {
    const spdlog::string_view_t level = spdlog::level::to_string_view(message.level);
    const std::string text =
        json_line(visible_payload(message), {level.data(), level.size()}, message.time);
    line.append(text.data(), text.data() + text.size());
    line.push_back('\n');
  }
  [[nodiscard]] std::unique_ptr<formatter> clone() const override {
    return std::make_unique<JsonFormatter>();
  }
};

/// The next word of a text, which is taken off it; a part in quotes belongs to its word.
std::string_view take_word(std::string_view& text) {
  bool is_quoted = false;
  std::size_t end = 0;
  for (; end < text.size() && (is_quoted || text[end] != ' '); ++end) {
    if (text[end] == '"') is_quoted = !is_quoted;
  }
  const std::string_view word = text.substr(0, end);
  text.remove_prefix(std::min(end + 1, text.size()));
  return word;
}

std::string_view unquoted(std::string_view value) {
  const bool is_quoted = value.size() >= 2 && value.front() == '"' && value.back() == '"';
  return is_quoted ? value.substr(1, value.size() - 2) : value;
}

}  // namespace

void set_up_log(const std::string& program, LogFormat format, LogLevel level) {
  spdlog::set_default_logger(spdlog::stderr_logger_mt(program));
  spdlog::set_level(level == LogLevel::info ? spdlog::level::info : spdlog::level::warn);
  if (format == LogFormat::json) {
    spdlog::set_formatter(std::make_unique<JsonFormatter>());
  } else {
    spdlog::set_formatter(std::make_unique<TextFormatter>());
  }
}

std::string json_line(std::string_view message, std::string_view level,
                      std::chrono::system_clock::time_point time) {
  const auto second = std::chrono::floor<std::chrono::seconds>(time);
  const auto part = std::chrono::floor<std::chrono::milliseconds>(time - second);
  nlohmann::ordered_json line;
  line["time"] = fmt::format("{:%FT%T}.{:03}Z", second, part.count());
  line["level"] = level;
  line["event"] = take_word(message);
  std::string rest;
  while (!message.empty()) {
    const std::string_view word = take_word(message);
    const std::size_t equals = word.find('=');
    // The first of a name counts: what comes later may be text of a file or a peer.
    if (equals != std::string_view::npos && equals > 0 && !line.contains(word.substr(0, equals))) {
      line[std::string(word.substr(0, equals))] = unquoted(word.substr(equals + 1));
    } else {
      rest += fmt::format("{}{}", rest.empty() ? "" : " ", word);
    }
  }
  if (!rest.empty()) line["text"] = rest;
  // What a peer says need not be UTF-8.
  return line.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace proofmass::wire
