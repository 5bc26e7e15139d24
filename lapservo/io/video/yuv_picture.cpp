#include "lapservo/io/video/yuv_picture.h"

extern "C" {
#include <libavutil/imgutils.h>
}

#include "lapservo/io/video/bgr_converter.h"
#include "lapservo/io/video/libav.h"

namespace lapservo::internal {
namespace {

AVPixelFormat format_of(YuvPicture::Layout layout) {
  using Layout = YuvPicture::Layout;
  switch (layout) {
    case Layout::yuyv:
      return AV_PIX_FMT_YUYV422;
    case Layout::uyvy:
      return AV_PIX_FMT_UYVY422;
    case Layout::nv12:
      return AV_PIX_FMT_NV12;
    case Layout::planar_420:
      return AV_PIX_FMT_YUV420P;
    case Layout::planar_422:
      return AV_PIX_FMT_YUV422P;
    case Layout::planar_444:
      return AV_PIX_FMT_YUV444P;
  }
  return AV_PIX_FMT_NONE;
}

}  // namespace

// swscale reads beyond the ends of rows: a copy has room for that.
bool convert_to_bgr(const YuvPicture& picture, const YuvColours& colours, cv::Mat& bgr) {
  thread_local BgrConverter converter;  // which serves images of one kind after another
  const AVPixelFormat format = format_of(picture.layout);
  const libav::Frame frame(av_frame_alloc());
  if (!frame) return false;
  frame->width = picture.size.width;
  frame->height = picture.size.height;
  frame->format = format;
  if (av_frame_get_buffer(frame.get(), 0) < 0) return false;
  auto planes = picture.planes;
  av_image_copy(frame->data, frame->linesize, planes.data(), picture.steps.data(), format, frame->width, frame->height);
  return converter.convert(*frame, colours, picture.by_field, bgr);
}

}  // namespace lapservo::internal
