// `mapmend vocab`: train a vocabulary on a folder of images, convert it, look at it, and measure how well it recognises
// places.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "libs/command_line/command_line.h"
#include "libs/features/orb_extractor.h"
#include "libs/retrieval/vocabulary.h"
#include "libs/retrieval/vocabulary_trainer.h"
#include "procs/mapmend/commands.h"

namespace mapmend {
namespace {

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

bool IsImage(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  for (const char* known : {".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".pgm", ".ppm", ".webp"}) {
    if (extension == known) return true;
  }
  return false;
}

// Image files of a folder and its subfolders, sorted, so that the result does not depend on the file system.
std::vector<std::string> FindImages(const std::string& directory) {
  if (!std::filesystem::is_directory(directory)) throw std::runtime_error(directory + " is not a folder");
  std::vector<std::string> paths;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(directory)) {
    if (entry.is_regular_file() && IsImage(entry.path())) paths.push_back(entry.path().string());
  }
  if (paths.empty()) throw std::runtime_error(directory + " holds no images (jpg, png, tif, bmp, pgm, ppm, webp)");
  std::sort(paths.begin(), paths.end());
  return paths;
}

struct TrainArguments {
  std::string directory, out;
  int num_features = 1000;
  VocabularyTrainerOptions trainer;
};

void PrintInfo(const Vocabulary& v) {
  std::printf(
      "branching factor  %d\nlevels            %d\nnodes             %d\nwords             %d\nmemory            %.1f "
      "MB\n"
      "hash              %s\n",
      v.BranchingFactor(), v.NumLevels(), v.NumNodes(), v.NumWords(), static_cast<double>(v.Bytes()) / 1e6,
      v.Hash().c_str());
}

void Train(const TrainArguments& arguments) {
  if (const std::string error = arguments.trainer.Check(); !error.empty()) throw UsageError(error);
  OrbOptions orb;
  orb.num_features = arguments.num_features;
  const OrbExtractor extractor(orb);
  const std::vector<std::string> paths = FindImages(arguments.directory);
  std::vector<std::vector<Descriptor>> images;
  int64_t num_features = 0;
  int num_unreadable = 0;
  for (size_t i = 0; i < paths.size(); ++i) {
    const cv::Mat image = cv::imread(paths[i], cv::IMREAD_GRAYSCALE);
    if (image.empty()) {
      std::fprintf(stderr, "skipped %s: not a readable image\n", paths[i].c_str());
      ++num_unreadable;
      continue;
    }
    images.push_back(extractor.Extract(image).descriptors);
    num_features += static_cast<int64_t>(images.back().size());
    if ((i + 1) % 100 == 0 || i + 1 == paths.size()) {
      std::printf("features: %zu of %zu images, %.0f features\n", i + 1, paths.size(),
                  static_cast<double>(num_features));
      std::fflush(stdout);
    }
  }
  int last_tenth = 0;
  const auto start = std::chrono::steady_clock::now();
  const Vocabulary vocabulary = TrainVocabulary(images, arguments.trainer, [&](double share) {
    const int tenth = static_cast<int>(share * 10);
    if (tenth <= last_tenth) return;
    last_tenth = tenth;
    std::printf("clustering: %d %%, %.0f s\n", tenth * 10, SecondsSince(start));
    std::fflush(stdout);
  });
  vocabulary.WriteBinary(arguments.out);
  std::printf("trained on %zu images (%d unreadable), %.0f features; written to %s\n", images.size(), num_unreadable,
              static_cast<double>(num_features), arguments.out.c_str());
  PrintInfo(vocabulary);
}

void Convert(const std::string& in, const std::string& out) {
  const Vocabulary vocabulary = Vocabulary::Read(in);
  if (std::filesystem::path(out).extension() == ".txt") {
    vocabulary.WriteDbow2Text(out);
  } else {
    vocabulary.WriteBinary(out);
  }
  std::printf("%s: %d words, hash %s\n", out.c_str(), vocabulary.NumWords(), vocabulary.Hash().c_str());
}

void Info(const std::string& path) {
  const auto start = std::chrono::steady_clock::now();
  const Vocabulary vocabulary = Vocabulary::Read(path);
  const double seconds = SecondsSince(start);
  PrintInfo(vocabulary);
  std::printf("file              %.1f MB, loaded in %.0f ms\n",
              static_cast<double>(std::filesystem::file_size(path)) / 1e6, seconds * 1e3);
}

}  // namespace

void AddVocabCommand(CLI::App* app) {
  CLI::App* vocab = app->add_subcommand("vocab", "Train, convert and inspect visual vocabularies");
  vocab->require_subcommand(1);

  auto train_arguments = std::make_shared<TrainArguments>();
  CLI::App* train = vocab->add_subcommand("train", "Train a vocabulary on a folder of images");
  train->add_option("DIR", train_arguments->directory, "Folder of images, searched with its subfolders")->required();
  train->add_option("--out", train_arguments->out, "Vocabulary file to write")->required();
  train->add_option("--branching", train_arguments->trainer.branching_factor, "Children per node")
      ->capture_default_str();
  train->add_option("--levels", train_arguments->trainer.num_levels, "Levels below the root")->capture_default_str();
  train->add_option("--features", train_arguments->num_features, "ORB features per image")->capture_default_str();
  train->add_option("--seed", train_arguments->trainer.seed, "Seed of the clustering")->capture_default_str();
  train->callback([train_arguments] { Train(*train_arguments); });

  auto files = std::make_shared<std::pair<std::string, std::string>>();
  CLI::App* convert =
      vocab->add_subcommand("convert", "Convert between mapmend's binary format and DBoW2's text format");
  convert->add_option("IN", files->first, "Vocabulary in either format")->required();
  convert->add_option("OUT", files->second, "File to write: DBoW2 text if it ends in .txt, else binary")->required();
  convert->callback([files] { Convert(files->first, files->second); });

  auto path = std::make_shared<std::string>();
  CLI::App* info = vocab->add_subcommand("info", "Size, hash and loading time of a vocabulary");
  info->add_option("FILE", *path, "Vocabulary in either format")->required();
  info->callback([path] { Info(*path); });

  AddVocabRecallCommand(vocab);
}

}  // namespace mapmend
