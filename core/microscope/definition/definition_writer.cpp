#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "core/microscope/definition/campaign_definition.hpp"
#include "core/microscope/definition/definition_entries.hpp"

namespace proofmass {
namespace {

using detail::Entry;

constexpr std::size_t line_length_max = 100;

struct Table {
  std::string path;
  std::vector<Entry> entries;  // Their paths are the keys alone.
};

// A table may stand in a TOML file only once, however its fields are ordered.
std::vector<Table> tables_of(const std::vector<Entry>& entries) {
  std::vector<Table> tables;
  for (const Entry& entry : entries) {
    const std::size_t dot = entry.path.rfind('.');
    const std::string path = entry.path.substr(0, dot);
    auto table = std::ranges::find(tables, path, &Table::path);
    if (table == tables.end()) table = tables.insert(tables.end(), {path, {}});
    table->entries.push_back({entry.path.substr(dot + 1), entry.text, entry.comment});
  }
  return tables;
}

std::string assignment(const Entry& entry) {
  return fmt::format("{} = {}\n", entry.path, entry.text);
}

std::string excitations_text(const std::vector<Excitation>& excitations) {
  if (excitations.empty()) return "excitations = []\n";
  std::string text = "excitations = [\n";
  for (const Excitation& excitation : excitations) {
    text += fmt::format("  {},\n", detail::excitation_text(excitation));
  }
  return text + "]\n";
}

std::string controllers_text(const MicroscopeCampaign& campaign) {
  std::string text;
  for (const ControllerConfig& controller : campaign.scenario.controllers) {
    text += "[[controller]]\n";
    for (const Entry& entry : detail::controller_entries(controller)) text += assignment(entry);
  }
  return text;
}

std::string_view element_of(std::size_t drawn) {
  const std::string_view name = drawn_names()[drawn];
  return name.substr(name.find('.') + 1);
}

// Code points: the bytes of UTF-8 that do not continue another.
std::size_t width(std::string_view text) {
  return static_cast<std::size_t>(std::ranges::count_if(
      text, [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

/// Writes a campaign file for people.
class CommentedWriter {
 public:
  explicit CommentedWriter(const MicroscopeCampaign& campaign) : campaign_(campaign) {}

  std::string write() {
    write_head();
    for (const Table& table : tables_of(detail::scenario_entries(campaign_))) write_table(table);
    write_sessions();
    text_ += controllers_text(campaign_);
    write_dispersions();
    return std::move(text_);
  }

 private:
  void write_head() {
    text_ =
        "# A Proofmass campaign: run it with `proofmass run FILE`.\n"
        "#\n"
        "# Names carry their units, all SI. What is left out keeps its nominal value, which is the "
        "one\n"
        "# shown here unless this file was changed. Citations are of [Hardy2013]: Hardy, Levy,\n"
        "# Rodrigues, Touboul, Métris, Validation of the in-flight calibration procedures for the\n"
        "# MICROSCOPE space mission, Advances in Space Research (2013).\n"
        "#\n"
        "# Tables that are not in force are not shown: [realism], whose keys\n"
        "# hardy2013-realistic.toml lists, [[controller]], a transfer function of one axis of a\n"
        "# loop (core/microscope/control/README.md), and what sessions that test add to a "
        "campaign,\n"
        "# which mission-2013.toml has.\n";
  }

  // What a preset sets is shown but not stated: a stated value would win over another preset.
  [[nodiscard]] bool is_from_preset(const std::string& path) const {
    return std::ranges::any_of(preset_entries_,
                               [&](const Entry& entry) { return entry.path == path; });
  }

  void write_table(const Table& table) {
    text_ += '\n';
    for (const auto& [path, note] : table_notes) {
      if (path == table.path) text_ += note;
    }
    text_ += fmt::format("[{}]\n", table.path);
    std::vector<std::string> lines;
    std::size_t column = 0;
    for (const Entry& entry : table.entries) {
      std::string line = fmt::format("{} = {}", entry.path, entry.text);
      if (is_from_preset(table.path + "." + entry.path)) line.insert(0, "# ");
      column = std::max(column, width(line) + 2);
      lines.push_back(std::move(line));
    }
    for (std::size_t i = 0; i < lines.size(); ++i) {
      write_line(lines[i], table.entries[i].comment, column);
    }
  }

  void write_line(const std::string& line, const std::string& comment, std::size_t column) {
    if (comment.empty()) {
      text_ += line + "\n";
    } else if (column + 2 + width(comment) > line_length_max) {
      text_ += fmt::format("# {}\n{}\n", comment, line);
    } else {
      text_ += line + std::string(column - width(line), ' ') + "# " + comment + "\n";
    }
  }

  void write_sessions() {
    text_ +=
        "\n# The sessions, in the order in which they are flown. Each starts at perigee and lasts "
        "whole\n"
        "# orbits. Lines are [i, j] or [i, j, k]: the frequency i f_orb + j f + k f_spin, f being "
        "that\n"
        "# of the excitation; i, j and k need not be whole, and j is a list where the session has\n"
        "# several excitations. Those of fit_lines give the estimate, those of known_lines are "
        "fitted\n"
        "# beside them. Every target needs a session; several share it. A session with the target\n"
        "# \"ep_test\" has no lines and tests the equivalence principle. Further keys:\n"
        "# spin_rate_rad_s = 0 (2π f_spin, of the frame that the attitude loop holds, about Y) "
        "and\n"
        "# drag_free = \"common\" (\"sensor_1\", \"sensor_2\").\n";
    const std::vector<Entry> plain = detail::session_entries(Session{});
    for (const Session& session : campaign_.scenario.sessions) {
      text_ += "\n[[session]]\n";
      for (const Entry& entry : detail::session_entries(session)) {
        if (entry.path == "fit_lines" && !session.excitations.empty()) {
          text_ += excitations_text(session.excitations);
        }
        const bool is_line = entry.path == "fit_lines" || entry.path == "known_lines";
        if (is_test(session) && is_line) continue;
        if (!is_left_out(entry, plain)) text_ += assignment(entry);
      }
    }
  }

  [[nodiscard]] static bool is_left_out(const Entry& entry, const std::vector<Entry>& plain) {
    if (entry.path != "spin_rate_rad_s" && entry.path != "drag_free") return false;
    const auto same = std::ranges::find(plain, entry.path, &Entry::path);
    return same != plain.end() && same->text == entry.text;
  }

  void write_dispersions() {
    text_ +=
        "\n# What is drawn for each run, by its law: uniform (minimum, maximum), normal (mean,\n"
        "# standard_deviation), truncated_normal (all four), fixed (value), table (file, "
        "column: a\n"
        "# comma-separated file with headings, one row a run; independent = true: its rows are\n"
        "# independent draws, else no interval or verdict follows from them), discrete (values,\n"
        "# probabilities), truncated (as truncated_normal, the mean anywhere), derived "
        "(expression:\n"
        "# of other quantities) or correlated (mean, standard_deviation; with: earlier normal\n"
        "# quantities; correlations, or covariances: with each). A table such as\n"
        "# [dispersion.offcentring_m.x] changes the law of one element.\n";
    for (const DrawGroup& group : draw_groups()) {
      if (!detail::is_left_out(campaign_, group)) write_group(group);
    }
  }

  void write_group(const DrawGroup& group) {
    const Dispersion& of_group = campaign_.dispersions[group.first];
    text_ += fmt::format("\n# {}\n# Elements: {}", group.comment, element_of(group.first));
    for (std::size_t i = group.first + 1; i < group.first + group.count; ++i) {
      text_ += fmt::format(", {}", element_of(i));
    }
    text_ += fmt::format("\n[dispersion.{}]\n", group.name);
    for (const Entry& entry : detail::law_entries(of_group)) text_ += assignment(entry);
    for (std::size_t i = group.first + 1; i < group.first + group.count; ++i) {
      if (campaign_.dispersions[i] == of_group) continue;
      text_ += fmt::format("{} = {}\n", element_of(i),
                           detail::dispersion_text(campaign_.dispersions[i]));
    }
  }

  static constexpr std::array<std::pair<std::string_view, std::string_view>, 6> table_notes{{
      {"campaign",
       "# Further keys: realisations = 4 gives each instrument four runs, which differ in their "
       "noise;\n"
       "# design = \"sobol\" or \"latin_hypercube\" with points = 32 covers the laws evenly.\n"},
      {"environment",
       "# External accelerations of the satellite, each axis mean + a1 cos(n t + phase) +\n"
       "# a2 cos(2 n t + phase), n being the mean motion; or rows of a file (kind = \"file\",\n"
       "# file = \"environment.csv\") with the columns time_s,linear_x_m_s2,linear_y_m_s2,\n"
       "# linear_z_m_s2,angular_x_rad_s2,angular_y_rad_s2,angular_z_rad_s2.\n"},
      {"noise",
       "# Sensor noise has the one-sided density white²(1 + f_p/f) + rise²(f/f_r)⁴/(1 + "
       "(f/f_l)⁴).\n"
       "# The preset sets what is commented out below; uncomment a line to replace its value.\n"},
      {"acceptance", "# Draws outside the bounds of [Hardy2013] tab:Budget are drawn again.\n"},
      {"objective", "# Largest acceptable errors, [Hardy2013] tab:perfo-numerical.\n"},
      {"budget", "# Levels and bounds of [Hardy2013] tab:Budget and tab:Budget_cali.\n"},
  }};

  const MicroscopeCampaign& campaign_;
  std::vector<Entry> preset_entries_ = preset_entries(campaign_);
  std::string text_;

  // The entries of noise that equal those of its preset.
  static std::vector<Entry> preset_entries(const MicroscopeCampaign& campaign) {
    MicroscopeCampaign preset = campaign;
    preset.scenario.noise = noise_preset(campaign.scenario.noise.preset);
    const std::vector<Entry> stated = detail::scenario_entries(campaign);
    const std::vector<Entry> set = detail::scenario_entries(preset);
    std::vector<Entry> same;
    for (std::size_t i = 0; i < stated.size(); ++i) {
      const bool is_set = stated[i].path.starts_with("noise.") &&
                          stated[i].path != "noise.preset" && stated[i].path != "noise.scale";
      if (is_set && stated[i].text == set[i].text) same.push_back(stated[i]);
    }
    return same;
  }
};

bool is_later_key(std::string_view path) {
  static constexpr std::array<std::string_view, 4> later_keys{
      "budget.test_spin_rate_rad_s", "drag_free.resonator_damping", "noise.sensor_1_factor",
      "noise.sensor_2_factor"};
  static constexpr std::array<std::string_view, 5> later_stems{
      "gaps.", "noise.wire.", "sensor.position_", "sensor.sensor_1_", "sensor.sensor_2_"};
  return std::ranges::find(later_keys, path) != later_keys.end() ||
         std::ranges::any_of(later_stems,
                             [&](std::string_view stem) { return path.starts_with(stem); });
}

// What came after the first release is left out where it is nominal, so that the text of a campaign
// remains the one that it was stored with. Where a preset sets another value, even the nominal one
// is stated, because the preset of a text applies first.
std::vector<detail::Entry> canonical_entries(const MicroscopeCampaign& campaign) {
  MicroscopeCampaign of_sessions;  // Some keys are there only with sessions that test.
  of_sessions.scenario.sessions = campaign.scenario.sessions;
  MicroscopeCampaign preset = of_sessions;
  preset.scenario.noise = noise_preset(campaign.scenario.noise.preset);
  const std::vector<detail::Entry> nominal = detail::scenario_entries(of_sessions);
  const std::vector<detail::Entry> of_preset = detail::scenario_entries(preset);
  const auto has = [](const std::vector<detail::Entry>& all, const detail::Entry& entry) {
    return std::ranges::find(all, entry.path, &Entry::path)->text == entry.text;
  };
  std::vector<detail::Entry> entries = detail::scenario_entries(campaign);
  std::erase_if(entries, [&](const detail::Entry& entry) {
    return is_later_key(entry.path) && has(nominal, entry) && has(of_preset, entry);
  });
  return entries;
}

}  // namespace

std::string canonical_definition(const MicroscopeCampaign& campaign) {
  std::string text;
  for (const Table& table : tables_of(canonical_entries(campaign))) {
    text += fmt::format("[{}]\n", table.path);
    for (const Entry& entry : table.entries) text += assignment(entry);
  }
  for (const Session& session : campaign.scenario.sessions) {
    text += "[[session]]\n";
    for (const Entry& entry : detail::session_entries(session)) text += assignment(entry);
    text += excitations_text(session.excitations);
  }
  text += controllers_text(campaign);
  for (const DrawGroup& group : draw_groups()) {
    if (detail::is_left_out(campaign, group)) continue;
    text += fmt::format("[dispersion.{}]\n", group.name);
    for (std::size_t i = group.first; i < group.first + group.count; ++i) {
      text +=
          fmt::format("{} = {}\n", element_of(i), detail::dispersion_text(campaign.dispersions[i]));
    }
  }
  return text;
}

std::string commented_campaign(const MicroscopeCampaign& campaign) {
  return CommentedWriter(campaign).write();
}

}  // namespace proofmass
