#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/definition.hpp"
#include "core/error.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"

namespace proofmass {

class DataFiles;
class Document;

/// The campaign that a document defines, without the values of its data files. What is absent keeps
/// its nominal value, and without any `[[session]]` the sessions are the paper's; `noise.preset`
/// applies before the other keys of noise, the law of a dispersion group before those of its
/// elements. What is wrong is remembered by the document.
[[nodiscard]] MicroscopeCampaign read_definition(Document& document);

/// Rows of an environment file, checked for an orbit of that period.
///
/// @param name  For messages: path of the file that has the text.
/// @throws DefinitionError naming file, line and reason.
[[nodiscard]] EnvironmentTable parse_environment(std::string_view text, const std::string& name,
                                                 double orbit_period_s);

/// The campaign that a document and its data files define, checked.
/// @throws DefinitionError naming file, line, field, value and rule.
[[nodiscard]] MicroscopeCampaign read_campaign(Document& document, DataFiles& files);

/// What the method `joint` needs beyond what it needs to estimate at all: without it, its standard
/// errors are too small. Definitions of older campaigns may lack it.
/// @throws ConfigError naming the session.
void check_joint_campaign(const MicroscopeCampaign& campaign);

/// The definition of a valid campaign.
[[nodiscard]] Definition definition_of(const MicroscopeCampaign& campaign,
                                       TableColumns columns = TableColumns::included);

/// What a stored definition says of the results: its sessions are valid, and all else is what can
/// be read. Where they are not, that of the nominal campaign: the database of which it is has other
/// faults to report.
[[nodiscard]] Scenario recorded_scenario(std::string_view text);

/// The campaign of a definition that another program sent.
///
/// @param definition  Anything at all. Time and memory are in proportion to its size.
/// @param source      For messages: where it is from.
/// @throws DefinitionError unless it is, to the byte, the definition of a valid campaign.
[[nodiscard]] MicroscopeCampaign campaign_of(Definition definition,
                                             TableColumns columns = TableColumns::included,
                                             std::string_view source = "definition");

/// Every value of a campaign as TOML, in a fixed order and with the shortest numbers that read back
/// to the same bits. Rows of data files are not in it.
[[nodiscard]] std::string canonical_definition(const MicroscopeCampaign& campaign);

/// A campaign as TOML for people: each field with its meaning and rule, dispersions by group.
[[nodiscard]] std::string commented_campaign(const MicroscopeCampaign& campaign);

}  // namespace proofmass
