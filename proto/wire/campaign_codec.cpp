#include "proto/wire/campaign_codec.hpp"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <string>
#include <string_view>
#include <type_traits>

#include "core/error.hpp"
#include "proto/proofmass.pb.h"

namespace proofmass::wire::detail {
namespace {

constexpr int sessions_max = 64;
constexpr int excitations_max = 16;
constexpr int lines_max = 64;
constexpr double line_multiple_max = 1000.0;
constexpr int session_orbits_max = 10000;
constexpr int values_per_row = 7;

void require(bool condition, std::string_view field, const std::string& value,
             std::string_view rule) {
  if (!condition) throw ConfigError(field, value, rule);
}

void require_count(int count, int maximum, std::string_view field) {
  require(count <= maximum, field, fmt::format("{} entries", count),
          fmt::format("must be at most {}", maximum));
}

double finite(double value, std::string_view field) {
  require(std::isfinite(value), field, fmt::format("{}", value), "must be finite");
  return value;
}

/// The core enumerator with the value of a message's one, which has 0 for "not set".
template <typename Core, typename Sent>
Core enumerator(Sent sent, int maximum, std::string_view field) {
  const int value = static_cast<int>(sent);
  require(value >= 1 && value <= maximum, field, fmt::format("{}", value),
          fmt::format("must be an enumerator, 1 to {}", maximum));
  return static_cast<Core>(value);
}

// Fields: one visitor writes them, one reads them, and core's list names them.

struct FieldWriter {
  proto::Campaign& message;

  template <typename Value>
  void operator()(const FieldInfo& info, const Value& value) const {
    proto::Field& field = *message.add_fields();
    field.set_path(std::string(info.path));
    if constexpr (std::is_enum_v<Value>) {
      field.set_choice(static_cast<std::uint32_t>(value));
    } else if constexpr (std::is_integral_v<Value>) {
      field.set_integer(value);
    } else {
      field.set_number(value);
    }
  }
};

class FieldReader {
 public:
  explicit FieldReader(const proto::Campaign& message) {
    for (const proto::Field& field : message.fields()) {
      const bool is_new = fields_.emplace(field.path(), &field).second;
      require(is_new, "fields", field.path(), "must not be repeated");
    }
  }

  template <typename Value>
  void operator()(const FieldInfo& info, Value& value) {
    const auto found = fields_.find(info.path);
    require(found != fields_.end(), "fields", std::string(info.path), "must be there");
    read(info.path, *found->second, value);
    fields_.erase(found);
  }

  /// To be called when every known field has been visited.
  void expect_none_left() const {
    if (fields_.empty()) return;
    throw ConfigError("fields", fields_.begin()->first, "unknown field");
  }

 private:
  static void read(std::string_view path, const proto::Field& field, double& value) {
    require(field.value_case() == proto::Field::kNumber, path, "no number", "must be a number");
    value = finite(field.number(), path);
  }

  static void read(std::string_view path, const proto::Field& field, std::int64_t& value) {
    require(field.value_case() == proto::Field::kInteger, path, "no integer", "must be an integer");
    value = field.integer();
  }

  template <typename Choice>
  static void read(std::string_view path, const proto::Field& field, Choice& value) {
    static_assert(std::is_enum_v<Choice>);
    require(field.value_case() == proto::Field::kChoice, path, "no choice", "must be a choice");
    const std::size_t count = names_of(value).size();
    require(field.choice() >= 1 && field.choice() <= count, path, fmt::format("{}", field.choice()),
            fmt::format("must be in [1, {}]", count));
    value = static_cast<Choice>(field.choice());
  }

  std::map<std::string_view, const proto::Field*> fields_;
};

// Sessions.

void encode_line(const LineMultiple& line, proto::LineMultiple& message) {
  message.set_orbital(line.orbital);
  message.set_excitation(line.excitation);
  message.set_spin(line.spin);
  if (line.further == decltype(line.further){}) return;
  for (const double multiple : line.further) message.add_further(multiple);
}

LineMultiple decode_line(const proto::LineMultiple& message) {
  const auto checked = [](double multiple) {
    require(multiple >= -line_multiple_max && multiple <= line_multiple_max, "session.line",
            fmt::format("{}", multiple), fmt::format("must be within ±{}", line_multiple_max));
    return multiple;
  };
  LineMultiple line{.orbital = checked(message.orbital()),
                    .excitation = checked(message.excitation()),
                    .spin = checked(message.spin())};
  require_count(message.further_size(), static_cast<int>(line.further.size()),
                "session.line.further");
  for (int i = 0; i < message.further_size(); ++i) {
    line.further[static_cast<std::size_t>(i)] = checked(message.further(i));
  }
  return line;
}

void encode_excitation(const Excitation& excitation, proto::Excitation& message) {
  message.set_kind(static_cast<proto::ExcitationKind>(excitation.kind));
  message.set_axis(static_cast<proto::Axis>(excitation.axis));
  message.set_amplitude(excitation.amplitude);
  message.set_frequency_hz(excitation.frequency_hz);
  message.set_motion(static_cast<proto::MassMotion>(excitation.motion));
}

Excitation decode_excitation(const proto::Excitation& message) {
  return {.kind = enumerator<ExcitationKind>(message.kind(), 3, "excitation.kind"),
          .axis = enumerator<Axis>(message.axis(), 3, "excitation.axis"),
          .amplitude = finite(message.amplitude(), "excitation.amplitude"),
          .frequency_hz = finite(message.frequency_hz(), "excitation.frequency_hz"),
          .motion = enumerator<MassMotion>(message.motion(), 3, "excitation.motion")};
}

void encode_session(const Session& session, proto::Session& message) {
  message.set_name(session.name);
  message.set_target(static_cast<proto::SessionTarget>(session.target));
  message.set_num_orbits(static_cast<std::uint32_t>(session.num_orbits));
  message.set_spin_rate_rad_s(session.spin_rate_rad_s);
  message.set_drag_free(static_cast<proto::DragFreeSource>(session.drag_free));
  for (const auto& excitation : session.excitations) {
    encode_excitation(excitation, *message.add_excitations());
  }
  for (const auto& line : session.fit_lines) encode_line(line, *message.add_fit_lines());
  for (const auto& line : session.known_lines) encode_line(line, *message.add_known_lines());
}

Session decode_session(const proto::Session& message) {
  require(message.num_orbits() >= 1 && message.num_orbits() <= session_orbits_max,
          "session.num_orbits", fmt::format("{}", message.num_orbits()),
          fmt::format("must be in [1, {}]", session_orbits_max));
  require_count(message.excitations_size(), excitations_max, "session.excitations");
  require_count(message.fit_lines_size(), lines_max, "session.fit_lines");
  require_count(message.known_lines_size(), lines_max, "session.known_lines");

  Session session;
  session.name = message.name();
  session.target =
      enumerator<SessionTarget>(message.target(), num_session_targets, "session.target");
  session.num_orbits = static_cast<int>(message.num_orbits());
  session.spin_rate_rad_s = finite(message.spin_rate_rad_s(), "session.spin_rate_rad_s");
  session.drag_free = enumerator<DragFreeSource>(message.drag_free(), 3, "session.drag_free");
  for (const auto& excitation : message.excitations()) {
    session.excitations.push_back(decode_excitation(excitation));
  }
  for (const auto& line : message.fit_lines()) session.fit_lines.push_back(decode_line(line));
  for (const auto& line : message.known_lines()) session.known_lines.push_back(decode_line(line));
  return session;
}

// Dispersions.

void encode_dispersion(std::string_view name, const Dispersion& law, proto::Dispersion& message) {
  message.set_name(std::string(name));
  message.set_law(static_cast<proto::Law>(law.law));
  message.set_minimum(law.minimum);
  message.set_maximum(law.maximum);
  message.set_mean(law.mean);
  message.set_standard_deviation(law.standard_deviation);
  message.set_value(law.value);
  message.set_file(law.file);
  message.set_column(law.column);
}

Dispersion decode_dispersion(const std::string& name, const proto::Dispersion& message) {
  require(message.name() == name, "dispersions", message.name(), "must be " + name + " here");
  const std::string path = "dispersion." + name;
  Dispersion law;
  law.law = enumerator<Law>(message.law(), static_cast<int>(names_of(Law{}).size()), path + ".law");
  law.minimum = finite(message.minimum(), path + ".minimum");
  law.maximum = finite(message.maximum(), path + ".maximum");
  law.mean = finite(message.mean(), path + ".mean");
  law.standard_deviation = finite(message.standard_deviation(), path + ".standard_deviation");
  law.value = finite(message.value(), path + ".value");
  law.file = message.file();
  law.column = message.column();
  law.validate(path);
  return law;
}

DispersionSet decode_dispersions(const proto::Campaign& message) {
  require(message.dispersions_size() == static_cast<int>(num_drawn), "dispersions",
          fmt::format("{} entries", message.dispersions_size()),
          fmt::format("must be {}", num_drawn));
  DispersionSet laws;
  for (std::size_t i = 0; i < num_drawn; ++i) {
    laws[i] = decode_dispersion(drawn_names()[i], message.dispersions(static_cast<int>(i)));
  }
  return laws;
}

// Environment.

void encode_environment(const EnvironmentTable& table, proto::Campaign& message) {
  message.mutable_environment_values()->Reserve(static_cast<int>(table.size()) * values_per_row);
  for (const EnvironmentRow& row : table) {
    message.add_environment_values(row.time_s);
    for (const double value : row.linear_m_s2) message.add_environment_values(value);
    for (const double value : row.angular_rad_s2) message.add_environment_values(value);
  }
}

EnvironmentTable decode_environment(const proto::Campaign& message) {
  const auto& values = message.environment_values();
  constexpr int values_max = static_cast<int>(environment_rows_max) * values_per_row;
  require(values.size() % values_per_row == 0 && values.size() <= values_max, "environment_values",
          fmt::format("{} entries", values.size()),
          fmt::format("must be rows of {}, at most {} rows", values_per_row, environment_rows_max));
  EnvironmentTable table(static_cast<std::size_t>(values.size() / values_per_row));
  auto next = values.begin();
  for (EnvironmentRow& row : table) {
    row.time_s = finite(*next++, "environment_values");
    for (double& value : row.linear_m_s2) value = finite(*next++, "environment_values");
    for (double& value : row.angular_rad_s2) value = finite(*next++, "environment_values");
  }
  return table;
}

}  // namespace

void encode_campaign(const Campaign& campaign, proto::Campaign& message) {
  message.set_name(campaign.name);
  message.set_seed(campaign.seed);
  message.set_num_runs(campaign.num_runs);
  for_each_field(campaign.scenario, FieldWriter{message});
  for (const Session& session : campaign.scenario.sessions) {
    encode_session(session, *message.add_sessions());
  }
  for (std::size_t i = 0; i < num_drawn; ++i) {
    encode_dispersion(drawn_names()[i], campaign.dispersions[i], *message.add_dispersions());
  }
  message.set_environment_file(campaign.environment_file);
  encode_environment(campaign.environment_table, message);
}

Campaign decode_campaign(const proto::Campaign& message) {
  require(message.num_runs() >= 1 && message.num_runs() <= num_runs_max, "num_runs",
          fmt::format("{}", message.num_runs()), fmt::format("must be in [1, {}]", num_runs_max));
  require_count(message.sessions_size(), sessions_max, "sessions");

  Campaign campaign;
  campaign.name = message.name();
  campaign.seed = message.seed();
  campaign.num_runs = message.num_runs();
  FieldReader reader(message);
  for_each_field(campaign.scenario, reader);
  reader.expect_none_left();
  campaign.scenario.sessions.clear();
  for (const auto& session : message.sessions()) {
    campaign.scenario.sessions.push_back(decode_session(session));
  }
  campaign.scenario.validate();
  campaign.dispersions = decode_dispersions(message);
  campaign.environment_file = message.environment_file();
  campaign.environment_table = decode_environment(message);
  const bool needs_table = campaign.scenario.environment.kind == EnvironmentKind::file;
  require(needs_table != campaign.environment_table.empty(), "environment_values",
          fmt::format("{} rows", campaign.environment_table.size()),
          "must be there if environment.kind is file, and only then");
  if (needs_table) {
    validate_environment_table(campaign.environment_table, campaign.scenario.orbit.period_s);
  }
  return campaign;
}

}  // namespace proofmass::wire::detail
