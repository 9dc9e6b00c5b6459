#include "proto/frame.h"

#include <gtest/gtest.h>

namespace flamefield {
namespace {

Frame frame_of(PixelFormat format, int width, std::vector<unsigned char> bytes) {
  Frame frame;
  frame.camera = "cam03";
  frame.width_px = width;
  frame.height_px = 1;
  frame.format = format;
  std::vector<std::byte> data;
  for (unsigned char b : bytes) data.push_back(static_cast<std::byte>(b));
  frame.bytes = std::make_shared<const std::vector<std::byte>>(std::move(data));
  return frame;
}

TEST(Frame, GreyLevelsOfEveryFormat) {
  EXPECT_EQ(grey_levels(frame_of(PixelFormat::Mono8, 2, {1, 255}))->pixels, (std::vector<float>{1, 255}));
  EXPECT_EQ(grey_levels(frame_of(PixelFormat::Mono12, 2, {0xbc, 0x0a, 0xff, 0x0f}))->pixels,
            (std::vector<float>{0xabc, 0xfff}));
  EXPECT_EQ(grey_levels(frame_of(PixelFormat::Mono12Packed, 3, {0xab, 0x3c, 0x12, 0xff, 0x0f}))->pixels,
            (std::vector<float>{0xabc, 0x123, 0xfff}));
}

TEST(Frame, TooFewBytesAreNamedNotRead) {
  const auto result = grey_levels(frame_of(PixelFormat::Mono16, 3, {1, 2, 3, 4, 5}));
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::InvalidInput);
  EXPECT_NE(result.error().message.find("cam03"), std::string::npos);
}

TEST(Frame, NamesOfKindsAndCausesReadBack) {
  for (auto cause : {LossCause::Missed, LossCause::Incomplete, LossCause::Late, LossCause::Duplicate,
                     LossCause::CameraLost, LossCause::NoBuffer, LossCause::Corrupt}) {
    EXPECT_EQ(loss_cause_from_name(name_of(cause)), cause);
  }
  for (auto kind : {CaptureKind::Dark, CaptureKind::Background, CaptureKind::Flat, CaptureKind::Board,
                    CaptureKind::Burst, CaptureKind::Live}) {
    EXPECT_EQ(capture_kind_from_name(name_of(kind)), kind);
  }
  EXPECT_FALSE(capture_kind_from_name("flash"));
}

}  // namespace
}  // namespace flamefield
