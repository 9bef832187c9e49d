#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "core/campaign/law_set.hpp"
#include "core/campaign/sampling_design.hpp"

namespace proofmass {

class Document;

// What is wrong is remembered by the document, and found by Document::check().

/// Reads `campaign.name`, `seed`, `runs`, `realisations`, `design` and `points`.
void read_identity(Document& document, Campaign& campaign);

/// Reads a law where it differs from another one.
///
/// @param path         Of its table: `dispersion.offcentring_m.x`.
/// @param base         What is absent stays as it is here, unless the kind of the law changes.
/// @param is_assigned  The kind of the law is given on the command line: then keys of the law in
///                     the file are gone with it, and its centre may stay.
[[nodiscard]] Dispersion read_law(Document& document, const std::string& path,
                                  const Dispersion& base, bool is_assigned);

/// Whether the law has covariances, which as_correlations() divides once all laws are read.
[[nodiscard]] bool has_covariances(Document& document, const std::string& path);

/// Divides what read_law() took for correlations by the standard deviations of both quantities.
/// What is no drawn quantity is left to be refused.
void as_correlations(const LawSet& set, Dispersion& law);

/// @throws DefinitionError if a definition has values of `table` laws that are left out.
void check_columns(const Definition& definition, TableColumns columns);

/// The values of `table` laws for each run, as in Campaign::table_columns. A row of a file is the
/// value of one draw.
/// @param rows_of  Reads the column of a law, whose table is at `path`; what it throws is thrown.
[[nodiscard]] std::vector<std::vector<double>> read_table_columns(
    const LawSet& set, const Campaign& campaign,
    const std::function<std::vector<double>(const Dispersion& law, const std::string& path)>&
        rows_of);

}  // namespace proofmass
