#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"
#include "coordinator/net/campaign_files.hpp"
#include "coordinator/net/rate_meter.hpp"
#include "coordinator/store/store_writer.hpp"
#include "proto/wire/client_messages.hpp"

namespace proofmass::coordinator {

/// The campaigns of a coordinator: carries out what people ask for, and keeps in their files what
/// must outlive the process. Status comes from memory alone.
class CampaignDesk {
 public:
  /// @param state, writer  Outlive the desk.
  /// @param files          Null if nothing can be submitted and nobody wants statistics.
  CampaignDesk(State& state, StoreWriter& writer, CampaignFiles* files, CoordinatorStart start,
               TimePoint now);
  ~CampaignDesk();  ///< Waits for statistics that are being computed.
  CampaignDesk(const CampaignDesk&) = delete;
  CampaignDesk& operator=(const CampaignDesk&) = delete;

  /// Begins to serve a campaign.
  /// @throws Error if one of that name or number is served already, StoreError.
  void serve(ServedCampaign campaign, GivenUpRuns given_up, TimePoint now, Outbox& outbox);

  /// Carries out a client's request; what cannot be done is an ErrorReply.
  [[nodiscard]] wire::ClientReply answer(const wire::ClientRequest& request, TimePoint now,
                                         Outbox& outbox);

  /// Takes notice of what the dispatch did: rates, phases, campaigns that are finished. To be
  /// called some times a second.
  void review(TimePoint now, Outbox& outbox);

  [[nodiscard]] wire::CampaignStatus status_of(CampaignId id, TimePoint now) const;

  /// True if every campaign is finished or cancelled.
  [[nodiscard]] bool is_all_done() const;

  /// Ends the service of all campaigns and gives their files back, in the order in which they came.
  [[nodiscard]] std::vector<ServedCampaign> close();

 private:
  /// What came of bringing statistics up to date.
  struct Summarised {
    std::string failure;                    ///< Empty if nothing went wrong.
    std::optional<std::uint64_t> num_runs;  ///< That the stop rule asks for next.
  };

  /// What the desk knows of a campaign beside the dispatch's state.
  struct Served {
    std::filesystem::path file;
    std::string name;
    RateMeter rate;
    std::uint64_t num_committed_seen = 0;
    CampaignControl written;  ///< As the file has it.
    StopPlan plan;
    bool is_decided = false;                ///< The stop rule was checked with the runs of now.
    std::uint64_t num_failures_before = 0;  ///< Runs without an estimate, when it came.
    bool is_summary_due = false;
    std::uint64_t num_summarised = 0;  ///< Of the runs committed here.
    std::future<Summarised> summary;
  };

  wire::ClientReply carry_out(const wire::SubmitRequest& request, TimePoint now, Outbox& outbox);
  wire::ClientReply carry_out(const wire::ControlRequest& request, TimePoint now, Outbox& outbox);
  wire::ClientReply carry_out(const wire::StatusRequest& request, TimePoint now, Outbox& outbox);
  wire::ClientReply carry_out(const wire::WorkersRequest& request, TimePoint now, Outbox& outbox);
  void resubmit(CampaignId id, const wire::SubmitRequest& request, TimePoint now, Outbox& outbox);
  void extend(CampaignId id, const Campaign& wanted, TimePoint now, Outbox& outbox);
  void resume(CampaignId id, TimePoint now, Outbox& outbox);
  [[nodiscard]] std::optional<CampaignId> find(std::string_view name) const;
  [[nodiscard]] wire::DoneReply done_reply(CampaignId id) const;
  /// As shown and stored: a campaign whose stop rule is still to be checked is not finished.
  [[nodiscard]] Phase phase_of(CampaignId id) const;
  void review_failures(CampaignId id, const Served& served, Outbox& outbox);
  void review_control(CampaignId id, Served& served);
  void review_summary(CampaignId id, Served& served, TimePoint now, Outbox& outbox);
  void take_summary(CampaignId id, Served& served, TimePoint now, Outbox& outbox);
  void go_on_to(CampaignId id, std::uint64_t num_runs, TimePoint now, Outbox& outbox);
  void begin_summary(CampaignId id, Served& served);

  State& state_;
  StoreWriter& writer_;
  CampaignFiles* files_;
  CoordinatorStart start_;
  TimePoint began_at_;
  std::map<CampaignId, Served> served_;
};

}  // namespace proofmass::coordinator
