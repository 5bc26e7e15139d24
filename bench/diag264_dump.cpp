// Scratch: writes key frames of turns.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <opencv2/videoio.hpp>
#include "acceptance/frame_sets.h"
#include "bench/diag264.h"
#include "lapservo/core/angles.h"
#include "lapservo/io/libav.h"
using namespace lapservo; using namespace lapservo::acceptance; using namespace lapservo::internal;
static std::string types_of(const std::string& path) {
  AVFormatContext* f = nullptr; avformat_open_input(&f, path.c_str(), nullptr, nullptr); avformat_find_stream_info(f, nullptr);
  int s = av_find_best_stream(f, AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
  AVCodecContext* c = avcodec_alloc_context3(avcodec_find_decoder(f->streams[s]->codecpar->codec_id));
  avcodec_parameters_to_context(c, f->streams[s]->codecpar); avcodec_open2(c, c->codec, nullptr);
  AVPacket* p = av_packet_alloc(); AVFrame* fr = av_frame_alloc(); std::string out;
  auto drain = [&] { while (avcodec_receive_frame(c, fr) == 0) out += av_get_picture_type_char(fr->pict_type); };
  while (av_read_frame(f, p) == 0) { if (p->stream_index == s) { avcodec_send_packet(c, p); drain(); } av_packet_unref(p); }
  avcodec_send_packet(c, nullptr); drain(); return out;
}
int main(int argc, char** argv) {
  const int seed = std::atoi(argv[1]), i = std::atoi(argv[2]);
  Rig nominal = example_rig();
  Marker print = true_print(nominal, seed, i);
  const auto own_seed = static_cast<std::uint64_t>(100 * seed + i);
  auto there = turn264(nominal, 90, own_seed); auto places = there; places.insert(places.end(), there.rbegin(), there.rend());
  RenderedSet set; set.rig = nominal; set.rig.instruments[0].marker = print; set.configurations = places; set.seed = own_seed;
  const std::vector<TrueFrame> plain = rendered_frames(set);
  for (std::string camera : {"h264", "video", "none"}) {
    auto turned = plain; std::string types(turned.size(), '-');
    for (auto& f : turned) f.bgr = f.bgr.clone();
    if (camera == "h264") {
      const std::string path = "/tmp/p264/v.mp4";
      { cv::VideoWriter w(path, cv::CAP_FFMPEG, cv::VideoWriter::fourcc('a','v','c','1'), 30, turned[0].bgr.size()); for (auto& f : turned) w.write(f.bgr); }
      types = types_of(path);
      compress(turned, Encoder::opencv);
    }
    if (camera == "video") compress(turned, Encoder::lapservo);
    KeyFrames key(nominal, 0);
    for (size_t k = 0; k < turned.size(); ++k) key.add(turned[k].bgr, double(k));
    auto frames = key.take();
    const std::string name = "/tmp/p264/" + std::to_string(seed) + "_" + std::to_string(i) + "_" + camera;
    std::ofstream out(name + ".bin", std::ios::binary);
    std::ofstream(name + ".types") << types;
    for (auto& f : frames) {
      // the true pose with the frame, and the plain picture of the same rectangle
      const size_t k = size_t(f.time_s);
      const ShaftPose truth = pose_of(nominal, places[k][0]);
      Saved s; s.k = int(k); s.w = f.view.bgr.cols; s.h = f.view.bgr.rows; s.cx = f.view.camera.cx_px; s.cy = f.view.camera.cy_px;
      put(s.found, f.sighting.unknowns.pose()); put(s.truth, truth);
      s.blur_b = f.sighting.blur.boundaries_px; s.blur_s = f.sighting.blur.sides_px; s.film = f.sighting.film_m; s.tau = f.sighting.tau_rad;
      s.settled = f.sighting.settled; s.turned = f.turned_rad; s.type = types[k];
      out.write(reinterpret_cast<char*>(&s), sizeof s);
      const cv::Rect at(int(std::lround(nominal.camera.cx_px - s.cx)), int(std::lround(nominal.camera.cy_px - s.cy)), s.w, s.h);
      const cv::Mat a = f.view.bgr.clone(), b = plain[k].bgr(at).clone();
      out.write(reinterpret_cast<const char*>(a.data), s.w * s.h * 3); out.write(reinterpret_cast<const char*>(b.data), s.w * s.h * 3);
    }
    std::printf("%s: %zu frames %s\n", name.c_str(), frames.size(), types.c_str());
  }
}
