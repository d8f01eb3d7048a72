#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string>

#include "libs/drawing/svg_canvas.h"
#include "libs/drawing/top_view.h"

namespace mapmend {
namespace drawing_test {

using ::testing::HasSubstr;

// A camera that looks straight down at (x, y), its image's top towards +y.
Rigid3 Nadir(double x, double y) {
  return Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX())), Eigen::Vector3d(x, y, 50));
}

Trajectory LShapedFlight() {
  Trajectory trajectory;
  for (int i = 0; i <= 20; ++i) trajectory.push_back({i * 1000000, Nadir(10.0 * i, 0)});
  for (int i = 1; i <= 8; ++i) trajectory.push_back({(20 + i) * 1000000, Nadir(200, 10.0 * i)});
  return trajectory;
}

TEST(CategoryColorTest, FortyColoursDiffer) {
  std::set<std::string> colors;
  for (int i = 0; i < 40; ++i) {
    EXPECT_EQ(CategoryColor(i).size(), 7u);
    colors.insert(CategoryColor(i));
  }
  EXPECT_EQ(colors.size(), 40u);
}

// A colour as people without one kind of cones see it: linear RGB, after G. Machado, M. Oliveira, L. Fernandes, "A
// Physiologically-based Model for Simulation of Color Vision Deficiency", 2009.
std::array<double, 3> SeenBy(const std::array<std::array<double, 3>, 3>& eyes, const std::string& color) {
  std::array<double, 3> linear{}, seen{};
  for (size_t i = 0; i < 3; ++i) {
    const double v = std::stoi(color.substr(1 + 2 * i, 2), nullptr, 16) / 255.0;
    linear[i] = v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
  }
  for (size_t r = 0; r < 3; ++r) {
    for (size_t c = 0; c < 3; ++c) seen[r] += eyes[r][c] * linear[c];
    seen[r] = std::clamp(seen[r], 0.0, 1.0);
  }
  return seen;
}

// CIE 1976 colour difference.
double Difference(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  const auto lab = [](const std::array<double, 3>& c) {
    const auto f = [](double t) { return t > 0.008856 ? std::cbrt(t) : 7.787 * t + 16.0 / 116; };
    const double x = f((0.4124 * c[0] + 0.3576 * c[1] + 0.1805 * c[2]) / 0.95047),
                 y = f(0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]),
                 z = f((0.0193 * c[0] + 0.1192 * c[1] + 0.9505 * c[2]) / 1.08883);
    return std::array<double, 3>{116 * y - 16, 500 * (x - y), 200 * (y - z)};
  };
  const auto p = lab(a), q = lab(b);
  return std::hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]);
}

TEST(CategoryColorTest, TheFirstNineCanBeToldApartWithoutOneKindOfCones) {
  using Eyes = std::array<std::array<double, 3>, 3>;
  const Eyes kAll = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  const Eyes kNoRed = {
      {{0.152286, 1.052583, -0.204868}, {0.114503, 0.786281, 0.099216}, {-0.003882, -0.048116, 1.051998}}};
  const Eyes kNoGreen = {
      {{0.367322, 0.860646, -0.227968}, {0.280085, 0.672501, 0.047413}, {-0.01182, 0.04294, 0.968881}}};
  const Eyes kNoBlue = {
      {{1.255528, -0.076749, -0.178779}, {-0.078411, 0.930809, 0.147602}, {0.004733, 0.691367, 0.3039}}};
  for (const Eyes& eyes : {kAll, kNoRed, kNoGreen, kNoBlue}) {
    for (int a = 0; a < 9; ++a) {
      for (int b = 0; b < a; ++b)
        EXPECT_GT(Difference(SeenBy(eyes, CategoryColor(a)), SeenBy(eyes, CategoryColor(b))), 12) << a << ", " << b;
    }
  }
}

TEST(CategoryColorTest, NumbersOnColoursCanBeRead) {
  EXPECT_EQ(InkOn("#ffffff"), "#000000");
  EXPECT_EQ(InkOn("#000000"), "#ffffff");
  EXPECT_EQ(InkOn("#e69f00"), "#000000");
  EXPECT_EQ(InkOn("#4b3a8c"), "#ffffff");
}

TEST(RoundStepTest, IsOneTwoOrFiveTimesAPowerOfTen) {
  EXPECT_DOUBLE_EQ(RoundStep(1), 1);
  EXPECT_DOUBLE_EQ(RoundStep(4.9), 2);
  EXPECT_DOUBLE_EQ(RoundStep(73), 50);
  EXPECT_DOUBLE_EQ(RoundStep(0.019), 0.01);
}

TEST(SvgCanvasTest, EscapesTextAndRoundsNumbers) {
  SvgCanvas canvas(100, 50);
  canvas.BeginGroup("a < b & \"c\"");
  canvas.DrawText({1.0, 2.345}, "S0 <-> S1", Canvas::Font());
  canvas.EndGroup();
  canvas.DrawPolyline({{0, 0}, {-0.001, 7.5}}, {"#ff0000", 2});
  const std::string svg = canvas.Finish("x");
  EXPECT_THAT(svg, HasSubstr("<title>a &lt; b &amp; &quot;c&quot;</title>"));
  EXPECT_THAT(svg, HasSubstr("y=\"2.35\""));
  EXPECT_THAT(svg, HasSubstr(">S0 &lt;-&gt; S1</text>"));
  EXPECT_THAT(svg, HasSubstr("points=\"0,0 0,7.5\""));
  EXPECT_THAT(svg, HasSubstr("width=\"100\" height=\"50\""));
}

TEST(DominantPlaneTest, ShowsAFlightFromAboveInAnyFrame) {
  for (const double angle : {0.0, 1.0, 2.5}) {
    const Similarity3 tilt(3, Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d(1, 2, -1).normalized())),
                           {5, 6, 7});
    const Trajectory flight = TransformTrajectory(LShapedFlight(), tilt);
    const PlaneView view = DominantPlane(flight);
    const auto at = [&](size_t i) { return view.Project(flight[i].world_from_camera.translation); };
    const Eigen::Vector2d first_leg = at(20) - at(0), second_leg = at(28) - at(20);
    EXPECT_NEAR(first_leg.norm(), 600, 1e-6);
    EXPECT_NEAR(second_leg.norm(), 240, 1e-6);
    // Seen from above the flight turns left; from below it would turn right.
    EXPECT_NEAR(first_leg.x() * second_leg.y() - first_leg.y() * second_leg.x(), 600.0 * 240.0, 1e-3);
    EXPECT_GT(first_leg.x(), 0) << "the start lies on the left";
  }
}

TEST(DominantPlaneTest, AStraightLineTakesUpFromTheCameras) {
  Trajectory line;
  for (int i = 0; i < 10; ++i) line.push_back({i, Nadir(0.001 * (i % 2), i)});
  const PlaneView view = DominantPlane(line);
  EXPECT_NEAR(view.x_axis.cross(view.y_axis).z(), 1.0, 1e-3);
  EXPECT_NEAR(DominantPlane({line[0]}).x_axis.norm(), 1.0, 1e-12);
  EXPECT_NEAR(DominantPlane({}).x_axis.norm(), 1.0, 1e-12);
}

TEST(DominantPlaneTest, AHandHeldWalkIsSeenFromAboveItsHeads) {
  // Upright cameras on a walk in the x-z plane of a world with y down (the first camera's frame).
  Trajectory walk;
  for (int i = 0; i < 10; ++i) walk.push_back({i, Rigid3(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, i))});
  for (int i = 1; i < 6; ++i)
    walk.push_back({10 + i, Rigid3(Eigen::Quaterniond::Identity(), Eigen::Vector3d(i, 0, 9))});
  const PlaneView view = DominantPlane(walk);
  EXPECT_NEAR(view.x_axis.cross(view.y_axis).y(), -1.0, 1e-9);
}

TEST(GroundPlaneTest, IsXyUnlessAnotherAxisIsVertical) {
  EXPECT_EQ(GroundPlane(LShapedFlight()).y_axis, Eigen::Vector3d::UnitY());
  Trajectory street;  // y down, driving along z with a turn to x
  for (int i = 0; i < 10; ++i)
    street.push_back({i, Rigid3(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0.1 * i, 10 * i))});
  for (int i = 1; i < 6; ++i)
    street.push_back({10 + i, Rigid3(Eigen::Quaterniond::Identity(), Eigen::Vector3d(10 * i, 1, 90))});
  const PlaneView view = GroundPlane(street);
  EXPECT_EQ(view.x_axis, Eigen::Vector3d::UnitX());
  EXPECT_EQ(view.y_axis, Eigen::Vector3d::UnitZ());
}

TEST(ProjectPiecesTest, CutsWhereTimeJumps) {
  Trajectory trajectory = LShapedFlight();
  for (size_t i = 21; i < trajectory.size(); ++i) trajectory[i].utime += 270000000;
  const auto pieces = ProjectPieces(trajectory, PlaneView());
  ASSERT_EQ(pieces.size(), 2u);
  EXPECT_EQ(pieces[0].size(), 21u);
  EXPECT_EQ(pieces[1].size(), 8u);
  EXPECT_EQ(pieces[1][0], Eigen::Vector2d(200, 10));
}

TEST(TopViewTest, DrawsTracksAndMarksAlsoWhenThereIsLittleToDraw) {
  TopView view;
  view.title = "Nothing";
  EXPECT_THAT(TopViewSvg(view), HasSubstr("</svg>"));
  view.tracks.push_back({"one point", "", "#123456", 2, false, "0", {{{5, 5}}}});
  view.marks.push_back({{5, 5}, "lost: blur"});
  const std::string svg = TopViewSvg(view);
  EXPECT_THAT(svg, HasSubstr("#123456"));
  EXPECT_THAT(svg, HasSubstr("lost: blur"));
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_EQ(svg.find("inf"), std::string::npos);
}

}  // namespace drawing_test
}  // namespace mapmend
