#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

namespace mapmend {

// What a page asks of the thread that has the map and the bus: a few at a time, answered one after the other.
class LiveQuestions {
 public:
  struct Question {
    enum class Kind { kEdgePicture, kKeyframePicture, kDecision };
    Kind kind = Kind::kEdgePicture;
    std::string a, b;  // submaps, by PageKey; kKeyframePicture: a alone
    int keyframe = -1;
    bool features = true;   // kKeyframePicture: drawn into the image
    bool disabled = false;  // kDecision
  };
  struct Answer {
    int status = 200;  // of HTTP
    std::string type = "text/plain; charset=utf-8", content;
  };

  // Waits for the answer, from any thread. A status of 503: there are too many questions already, or no answer came.
  Answer Ask(const Question& question, std::chrono::milliseconds timeout);
  // Answers the oldest question, if there is one, in this thread.
  void AnswerOne(const std::function<Answer(const Question&)>& answer);

 private:
  static constexpr size_t kMostWaiting = 6;
  struct Waiting {
    Question question;
    Answer answer;
    bool is_answered = false;
  };
  std::mutex mutex_;
  std::condition_variable answered_;
  std::deque<std::shared_ptr<Waiting>> waiting_;  // guarded by mutex_
};

}  // namespace mapmend
