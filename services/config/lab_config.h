#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "proto/board.h"
#include "proto/error.h"
#include "proto/frame.h"
#include "proto/volume.h"

namespace flamefield {

// One [[camera]] of lab.toml.
struct LabCamera {
  std::string name;     // as in rig.yaml
  std::string address;  // IPv4 address; empty: found by serial, else by user-defined name
  std::string serial;   // refused when another camera is there; empty: any
};

// [cluster] of lab.toml: workers as jobs of Slurm.
struct ClusterConfig {
  std::string endpoint;  // endpoint: of the dispatcher, as the nodes see it; empty: [bus] dispatcher
  std::filesystem::path directory;  // directory: shared by all nodes, its volumes/ is the data directory's
                                    // own; empty: the data directory
  std::string worker;  // worker: flamefield-worker on the nodes; empty: the one beside this program
  std::string partition, live_partition;  // partition, live_partition; empty: Slurm's default, none
  std::string account, constraint;        // account, constraint; empty: none
  std::vector<std::string> sbatch;        // sbatch: further arguments
  std::string setup;                      // setup: shell lines before the worker starts
  int pilots = 16;                        // pilots: at most, [1, 20 000]
  int cores = 2;                          // cores: of a pilot, [1, 4096]
  int memory_mib = 0;       // memory_mib: of a pilot, [0, 100 000 000]; 0: as recorded runs of the work took
  int minutes = 0;          // minutes: time limit of a pilot, [0, 100 000]; 0: likewise
  int most_minutes = 1440;  // most_minutes: of that estimate, [1, 100 000]
  int idle_s = 60;          // idle_s: a pilot without work for so long ends, [1, 1 000 000]
  int drain_s = 120;        // drain_s: before its time limit a pilot takes no further job, [1, 65 535]
  int silence_s = 300;      // silence_s: a pilot that hears nothing of the dispatcher ends, [1, 1 000 000]
  int key_days = 14;        // key_days: the pilots' key is out of date then, [1, 3650]
};

// What a laboratory sets once: lab.toml. Each comment is the key; lengths and times carry their unit in it.
struct LabConfig {
  std::string laboratory = "laboratory";                     // laboratory
  std::filesystem::path data_directory = "flamefield-data";  // data_directory: spool, ledger, volumes
  std::vector<LabCamera> cameras;  // [[camera]] name, address, serial; none: simulated array
  // [trigger]
  double trigger_rate_hz = 5;           // rate_hz, (0, 1000]
  std::string trigger_source = "line";  // source: line or action, which this program then sends itself
  std::string trigger_line = "Line1";   // line
  // action_device_key, action_group_key, action_group_mask, [0, 4 294 967 295]; of GigE Vision action
  // commands
  std::uint32_t action_device_key = 1, action_group_key = 1, action_group_mask = 1;
  std::string action_broadcast;  // action_broadcast: one packet for all; empty: one to each camera
  // [capture]
  int exposure_us = 1000;                         // exposure_us, [1, 10 000 000]
  double gain_db = 0;                             // gain_db, [0, 48]
  PixelFormat pixel_format = PixelFormat::Mono8;  // pixel_format: Mono8 Mono12 Mono12Packed Mono16
  int trigger_delay_us = 0;                       // trigger_delay_us, [0, 1 000 000]
  int black_level_raw = 0;                        // black_level_raw, [0, 100 000]
  int binning_x = 1, binning_y = 1;               // binning_x, binning_y, [1, 4]
  int offset_x_px = 0, offset_y_px = 0;           // offset_x_px, offset_y_px, [0, 65 535], of binned pixels
  int width_px = 0, height_px = 0;                // width_px, height_px, [0, 65 535]; 0: all of the sensor
  int history_pulses = 50;                        // history_pulses, [0, 100 000]: kept in memory in standby
  int history_mib = 512;                          // history_mib, [1, 1 000 000]: as long as they fit in this
  // [network] between the cameras and this machine
  int packet_size_bytes = 1500;   // packet_size_bytes, [220, 16404]
  double link_mbit_per_s = 1000;  // link_mbit_per_s: of the uplink that all cameras share, [10, 400 000]
  int switch_buffer_kib = 128;    // switch_buffer_kib: what the switch holds back for it, [0, 1 000 000]
  // [simulator], when there are no [[camera]]s
  int simulated_cameras = 15;                  // cameras, [1, 64]
  std::uint64_t simulator_seed = 1;            // seed
  std::string simulated_flame = "stratified";  // flame: a phantom's name
  // [calibration]
  BoardSpec board;  // board = "9x6", square_mm, board_type, marker_mm, dictionary
  Eigen::Vector3d reference_centre_mm{0, 0, 0};  // reference_centre_mm = [X, Y, Z]: board on the burner
  double reference_azimuth_rad = 0;              // reference_azimuth_deg: where its face looks
  Eigen::Vector3d volume_centre_mm{0, 40, 0};    // volume_centre_mm = [X, Y, Z]: where errors count,
  double volume_diameter_mm = 60;                // volume_diameter_mm, (0, 10 000]
  double volume_height_mm = 80;                  // volume_height_mm, (0, 10 000]
  // [web]
  std::string http_host = "127.0.0.1";  // host
  int http_port = 8080;                 // port, [0, 65535]; 0: any free one
  std::string http_public_name;         // public_name: of a reverse proxy in front; empty: none
  // [bus]; empty: within the process
  std::string dispatcher_endpoint;       // dispatcher, e.g. "tcp://10.0.0.1:7300"
  std::string events_endpoint;           // events
  std::string acquisition_endpoint;      // acquisition
  std::filesystem::path keys_directory;  // keys: CURVE key files; empty: beside the data
  // [reconstruction]; paths are relative to lab.toml
  std::filesystem::path rig;                  // rig
  std::filesystem::path recipe;               // recipe
  int workers = 0;                            // workers, [0, 256]; 0: one a core
  int threads_per_worker = 0;                 // threads, [0, 1024]; 0: all
  Grid domain = centred_grid(52, 55, 52, 1);  // size = [NX, NY, NZ], spacing_mm, origin_mm = [X, Y, Z]
  ClusterConfig cluster;                      // [cluster]
};

// Defaults where a key is absent. Unknown keys, wrong types and values out of range are InvalidInput with
// file and line. Relative paths are taken from the folder of the file.
Result<LabConfig> read_lab_config(const std::filesystem::path& path);

}  // namespace flamefield
