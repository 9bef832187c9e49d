#include "core/campaign/error_budget.hpp"

namespace proofmass {

std::vector<std::vector<double>> ErrorBudget::coefficients(std::size_t num_quantities) const {
  std::vector<std::vector<double>> coefficients(infos.size(), std::vector<double>(num_quantities));
  for (std::size_t quantity = 0; quantity < num_quantities; ++quantity) {
    std::vector<double> errors(num_quantities);
    errors[quantity] = 1.0;
    const Budget budget = after(errors);
    for (std::size_t i = 0; i < infos.size(); ++i) coefficients[i][quantity] = budget.entries[i];
  }
  return coefficients;
}

}  // namespace proofmass
