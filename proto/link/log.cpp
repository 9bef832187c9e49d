#include "proto/link/log.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/logger.h>
#include <spdlog/sinks/stdout_sinks.h>

#include <array>
#include <memory>
#include <nlohmann/json.hpp>
#include <string_view>
#include <variant>

#include "proto/text/visible_text.hpp"

namespace proofmass::wire {
namespace {

spdlog::level::level_enum level_of(Severity severity) {
  constexpr std::array levels{spdlog::level::info, spdlog::level::warn, spdlog::level::err};
  return levels.at(static_cast<std::size_t>(severity));
}

std::string_view name_of(Severity severity) {
  const spdlog::string_view_t name = spdlog::level::to_string_view(level_of(severity));
  return {name.data(), name.size()};
}

}  // namespace

Log make_log(const std::string& program, LogFormat format, LogLevel level) {
  const auto logger =
      std::make_shared<spdlog::logger>(program, std::make_shared<spdlog::sinks::stderr_sink_mt>());
  logger->set_level(level == LogLevel::info ? spdlog::level::info : spdlog::level::warn);
  // In UTC, as all times in databases and JSON: logs of several machines are laid side by side.
  logger->set_pattern(format == LogFormat::json ? "%v" : "[%Y-%m-%d %T.%eZ] [%n] [%l] %v",
                      spdlog::pattern_time_type::utc);
  // std::function shares the logger with its copies.
  return [logger, format](const Event& event) {
    logger->log(level_of(event.severity), format == LogFormat::text
                                              ? to_text(event)
                                              : json_line(event, std::chrono::system_clock::now()));
  };
}

std::string json_line(const Event& event, std::chrono::system_clock::time_point time) {
  const auto second = std::chrono::floor<std::chrono::seconds>(time);
  const auto part = std::chrono::floor<std::chrono::milliseconds>(time - second);
  nlohmann::ordered_json line;
  line["time"] = fmt::format("{:%FT%T}.{:03}Z", second, part.count());
  line["level"] = name_of(event.severity);
  line["event"] = event.kind;
  std::string remarks;
  for (const Field& field : event.fields) {
    const auto* const text = std::get_if<std::string>(&field.value);
    if (field.name.empty() && text != nullptr) {
      remarks += (remarks.empty() ? "" : " ") + *text;
    } else {
      std::visit([&](const auto& value) { line[std::string(field.name)] = value; }, field.value);
    }
  }
  if (!remarks.empty()) line["text"] = remarks;
  // JSON lets characters through that steer a terminal; visible_text() writes them as JSON does.
  return visible_text(line.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
}

}  // namespace proofmass::wire
