#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/net/answers.hpp"
#include "coordinator/net/authentication/rights.hpp"
#include "coordinator/net/background.hpp"
#include "coordinator/net/campaign_files.hpp"
#include "coordinator/net/campaign_service.hpp"
#include "coordinator/net/client_gateway.hpp"
#include "coordinator/net/service.hpp"
#include "coordinator/net/service_snapshot.hpp"

namespace proofmass::coordinator {

/// Carries out what clients ask for, if they may ask for it. The files of submitted campaigns are
/// made, opened and extended in the background, so that the service goes on meanwhile.
class RequestService {
 public:
  /// @param campaigns  Outlives this object.
  RequestService(const ServiceContext& context, CampaignService& campaigns);

  /// Responds at once, or later if a file must be opened, made or extended, or if the campaign of a
  /// submission is being changed, opened or closed.
  /// @throws Error, std::exception with the reason if the request is not carried out: the asker may
  ///         not ask for it, has submitted too much, or too many requests are under way.
  void carry_out(Request request, const Asker& asker, Respond respond);

  /// What a client is told of the coordinator, without any campaign.
  [[nodiscard]] proto::StatusReply service_status() const;

  /// Carries out submissions that had to wait, and responds to questions whose answers are there.
  /// To be called several times a second.
  void review();

 private:
  using Submitted = std::shared_ptr<const Request>;

  using Holdings = CampaignService::Holdings;

  /// What is being opened, made or changed in the background.
  struct UnderWay {
    std::string owner;
    Holdings added;  ///< To the unfinished campaigns of the owner.
  };

  /// A request that waits until its campaign is no longer being changed.
  struct Deferred {
    std::function<void()> ask_again;
    Respond respond;
  };

  void control(const proto::ControlRequest& request, const Asker& asker, const Respond& respond);
  void control_served(CampaignId id, proto::ControlAction action, int priority,
                      const Respond& respond);
  /// Says in the log, and in the campaign's database while that is served, who has changed a
  /// campaign, once it is done.
  /// @param fields  What was asked for.
  [[nodiscard]] Respond noted(const std::string& campaign, wire::Fields fields, const Asker& asker,
                              Respond respond);
  void log(Event event, const std::string& campaign) const;
  void defer(std::function<void()> ask_again, const Respond& respond);
  [[nodiscard]] proto::ReplyEnvelope status(const proto::StatusRequest& request) const;
  [[nodiscard]] proto::ReplyEnvelope workers(const proto::WorkersRequest& request) const;
  [[nodiscard]] proto::ReplyEnvelope release_host(const std::string& host);
  void ask(const proto::AnswerRequest& request, const Asker& asker, const Respond& respond);
  [[nodiscard]] proto::ReplyEnvelope take(const proto::FactoryReport& report, const Asker& asker);

  void submit(const Submitted& request, const Asker& asker, Respond respond);
  [[nodiscard]] bool is_busy(const std::string& name) const;
  /// What a submission adds to the unfinished campaigns of an owner.
  /// @param entry  The campaign, if it is known.
  [[nodiscard]] Holdings added_by(const Request& request,
                                  const std::optional<CampaignRecord>& entry) const;
  /// To be asked wherever a request makes a campaign active or larger.
  /// @throws Error if its owner would have more than SubmissionLimits allow.
  void check_limits(const std::string& campaign, const std::string& owner,
                    const Holdings& added) const;
  /// check_limits() for an action on a campaign whose file is open.
  void check_limits(const std::string& campaign, const CampaignRecord& entry,
                    proto::ControlAction action) const;
  /// @param closed  The campaign if it has been served; otherwise its file may have to be made.
  void open_file(const Submitted& request, const Asker& asker,
                 const std::optional<CampaignRecord>& closed, UnderWay under_way, Respond respond);
  [[nodiscard]] bool is_archived(const std::string& campaign) const;
  [[noreturn]] void refuse_as_not_served(const std::string& campaign) const;
  /// Opens the file of a campaign that has ended, and resumes it or retries its runs, if its owner
  /// may have it unfinished.
  void reopen(const CampaignRecord& campaign, proto::ControlAction action, const Respond& respond);
  void change_served(CampaignId id, const Submitted& request, UnderWay under_way, Respond respond);
  /// Opens or makes a file with `open` in the background, and serves it. If that fails, a file that
  /// was made for it is removed.
  /// @param activate  Stores what is to be different from now on, the phase at least.
  void serve_opened(const std::string& name, UnderWay under_way,
                    std::function<ServedCampaign()> open, std::function<void(Store&)> activate,
                    Respond respond);
  /// @param made  The file if it was made for this campaign; else empty.
  [[nodiscard]] proto::ReplyEnvelope serve(FileLook look, const std::filesystem::path& made);

  const ServiceContext& context_;
  CampaignService& campaigns_;
  FactoryReports factories_;
  /// Of the clock itself, as that of the context leaves out the time that the process was stopped.
  std::chrono::steady_clock::time_point began_at_ = std::chrono::steady_clock::now();
  std::map<std::string, UnderWay> under_way_;  ///< By the campaign's name.
  std::vector<Deferred> deferred_;
  Answers answers_;
};

}  // namespace proofmass::coordinator
