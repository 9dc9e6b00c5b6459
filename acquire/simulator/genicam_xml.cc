#include "acquire/simulator/genicam_xml.h"

#include <ios>
#include <sstream>
#include <string_view>
#include <utility>
#include <vector>

#include "acquire/pixel_code.h"
#include "acquire/simulator/registers.h"

namespace flamefield {

namespace {

using Entries = std::vector<std::pair<std::string_view, std::uint32_t>>;
// Which of several equal registers a feature means: a selector and the distance between the registers.
struct Selected {
  std::string_view by;
  std::uint32_t stride = 0;
};

// Writes GenICam nodes one by one; a category lists the features written since it was opened.
class XmlWriter {
 public:
  void text(std::string_view name, std::uint32_t address, int size, std::string_view access = "RO") {
    feature(name);
    out_ << "<StringReg Name=\"" << name << "\"><Address>" << address << "</Address><Length>" << size
         << "</Length><AccessMode>" << access << "</AccessMode><pPort>Device</pPort></StringReg>\n";
  }
  void reg(std::string_view name, std::uint32_t address, std::string_view access, Selected selected = {},
           std::string_view port = "Device") {
    out_ << "<IntReg Name=\"" << name << "\"><Address>" << address << "</Address>";
    if (selected.stride != 0) {
      out_ << "<pIndex Offset=\"" << selected.stride << "\">" << selected.by << "Value</pIndex>";
    }
    out_ << "<Length>4</Length><AccessMode>" << access << "</AccessMode><pPort>" << port
         << "</pPort><Cachable>NoCache</Cachable><Sign>Unsigned</Sign><Endianess>BigEndian</Endianess>"
         << "</IntReg>\n";
  }
  void integer(std::string_view name, std::uint32_t address, std::int64_t min, std::int64_t max,
               std::string_view access = "RW") {
    feature(name);
    out_ << "<Integer Name=\"" << name << "\"><pValue>" << name << "Reg</pValue><Min>" << min << "</Min><Max>"
         << max << "</Max><Inc>1</Inc></Integer>\n";
    reg(join(name, "Reg"), address, access);
  }
  // A real number kept as an integer: value = scale / register, or the register itself when scale is 0.
  void real(std::string_view name, std::uint32_t address, double min, double max, std::string_view unit,
            std::uint32_t scale = 0) {
    feature(name);
    out_ << "<Float Name=\"" << name << "\"><pValue>" << name << "Converter</pValue><Min>" << min
         << "</Min><Max>" << max << "</Max><Unit>" << unit << "</Unit></Float>\n<Converter Name=\"" << name
         << "Converter\">";
    if (scale == 0) {
      out_ << "<FormulaTo>FROM</FormulaTo><FormulaFrom>TO</FormulaFrom>";
    } else {
      out_ << "<FormulaTo>" << scale << "/FROM</FormulaTo><FormulaFrom>" << scale << "/TO</FormulaFrom>";
    }
    out_ << "<pValue>" << name << "Reg</pValue></Converter>\n";
    reg(join(name, "Reg"), address, "RW");
  }
  void choice(std::string_view name, std::uint32_t address, const Entries& entries, Selected selected = {}) {
    open_choice(name, entries);
    out_ << "<pValue>" << name << "Reg</pValue></Enumeration>\n";
    reg(join(name, "Reg"), address, "RW", selected);
  }
  // A choice that lives in the client: it picks which register the selected features mean.
  void selector(std::string_view name, const Entries& entries,
                const std::vector<std::string_view>& selected) {
    open_choice(name, entries);
    out_ << "<pValue>" << name << "Value</pValue>";
    for (std::string_view feature_name : selected) out_ << "<pSelected>" << feature_name << "</pSelected>";
    out_ << "</Enumeration>\n<Integer Name=\"" << name << "Value\"><Value>0</Value></Integer>\n";
  }
  void command(std::string_view name, std::uint32_t address, std::uint32_t value) {
    feature(name);
    out_ << "<Command Name=\"" << name << "\"><pValue>" << name << "Reg</pValue><CommandValue>" << value
         << "</CommandValue></Command>\n";
    reg(join(name, "Reg"), address, "RW");
  }
  void boolean(std::string_view name, std::uint32_t address, Selected selected = {}) {
    feature(name);
    out_ << "<Boolean Name=\"" << name << "\"><pValue>" << name
         << "Reg</pValue><OnValue>1</OnValue><OffValue>0</OffValue></Boolean>\n";
    reg(join(name, "Reg"), address, "RW", selected);
  }
  void chunk(std::string_view name, std::uint32_t id) {
    feature(name);
    out_ << "<Integer Name=\"" << name << "\"><pValue>" << name << "Reg</pValue></Integer>\n";
    reg(join(name, "Reg"), 0, "RO", {}, join(name, "Port"));
    out_ << "<Port Name=\"" << name << "Port\"><ChunkID>" << std::hex << id << std::dec
         << "</ChunkID></Port>\n";
  }
  // One register holds the size (bits 16 to 31, counted from the top) and the request for a test packet.
  void packet_size() {
    feature("GevSCPSPacketSize");
    out_ << "<Integer Name=\"GevSCPSPacketSize\"><pValue>GevSCPSPacketSizeReg</pValue><Min>220</Min>"
            "<Max>16404</Max><Inc>4</Inc></Integer>\n";
    masked("GevSCPSPacketSizeReg", "<LSB>31</LSB><MSB>16</MSB>");
    feature("GevSCPSFireTestPacket");
    out_ << "<Command Name=\"GevSCPSFireTestPacket\"><pValue>GevSCPSFireTestPacketReg</pValue>"
            "<CommandValue>1</CommandValue></Command>\n";
    masked("GevSCPSFireTestPacketReg", "<Bit>0</Bit>");
  }
  void fixed(std::string_view name, std::int64_t value) {
    feature(name);
    out_ << "<Integer Name=\"" << name << "\"><Value>" << value << "</Value></Integer>\n";
  }
  void category(std::string_view name) { categories_.push_back({std::string(name), {}}); }

  std::string finish() {
    std::ostringstream xml;
    xml << "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
           "<RegisterDescription ModelName=\"acA645_100gm\" VendorName=\"Basler\" ToolTip=\"Simulated "
           "camera\" "
           "StandardNameSpace=\"GEV\" SchemaMajorVersion=\"1\" SchemaMinorVersion=\"1\" "
           "SchemaSubMinorVersion=\"0\" MajorVersion=\"1\" MinorVersion=\"0\" SubMinorVersion=\"0\" "
           "ProductGuid=\"0\" VersionGuid=\"0\" xmlns=\"http://www.genicam.org/GenApi/Version_1_1\">\n"
           "<Category Name=\"Root\">";
    for (const Category& category : categories_) xml << "<pFeature>" << category.name << "</pFeature>";
    xml << "</Category>\n";
    for (const Category& category : categories_) {
      xml << "<Category Name=\"" << category.name << "\">";
      for (const std::string& name : category.features) xml << "<pFeature>" << name << "</pFeature>";
      xml << "</Category>\n";
    }
    xml << out_.str() << "<Port Name=\"Device\"/>\n</RegisterDescription>\n";
    return xml.str();
  }

 private:
  struct Category {
    std::string name;
    std::vector<std::string> features;
  };
  static std::string join(std::string_view a, std::string_view b) { return std::string(a).append(b); }
  void feature(std::string_view name) { categories_.back().features.emplace_back(name); }
  void masked(std::string_view name, std::string_view bits) {
    out_ << "<MaskedIntReg Name=\"" << name << "\"><Address>" << reg::kPacketSize
         << "</Address><Length>4</Length><AccessMode>RW</AccessMode><pPort>Device</pPort>"
         << "<Cachable>NoCache</Cachable>" << bits
         << "<Sign>Unsigned</Sign><Endianess>BigEndian</Endianess></MaskedIntReg>\n";
  }
  void open_choice(std::string_view name, const Entries& entries) {
    feature(name);
    out_ << "<Enumeration Name=\"" << name << "\">";
    for (const auto& [entry, value] : entries) {
      out_ << "<EnumEntry Name=\"" << entry << "\"><Value>" << value << "</Value></EnumEntry>";
    }
  }

  std::ostringstream out_;
  std::vector<Category> categories_;
};

void write_image_features(XmlWriter& xml, int width_px, int height_px) {
  xml.category("ImageFormatControl");
  xml.integer("SensorWidth", reg::kSensorWidth, 1, width_px, "RO");
  xml.integer("SensorHeight", reg::kSensorHeight, 1, height_px, "RO");
  xml.integer("Width", reg::kWidth, 1, width_px);
  xml.integer("Height", reg::kHeight, 1, height_px);
  xml.integer("OffsetX", reg::kOffsetX, 0, width_px - 1);
  xml.integer("OffsetY", reg::kOffsetY, 0, height_px - 1);
  Entries formats;
  for (const PixelCode& entry : kPixelCodes) formats.emplace_back(name_of(entry.format), entry.code);
  xml.choice("PixelFormat", reg::kPixelFormat, formats);
  xml.integer("BinningHorizontal", reg::kBinningX, 1, reg::kMaxBinning);
  xml.integer("BinningVertical", reg::kBinningY, 1, reg::kMaxBinning);
  xml.choice("TestImageSelector", reg::kTestImage, {{"Off", 0}, {"Testimage1", 1}});
  xml.category("AnalogControls");
  xml.integer("GainRaw", reg::kGainRaw, 0, 500);
  xml.integer("BlackLevelRaw", reg::kBlackLevelRaw, 0, 255);
}

void write_acquisition_features(XmlWriter& xml) {
  xml.category("AcquisitionControls");
  xml.choice("AcquisitionMode", reg::kAcquisitionMode, {{"SingleFrame", 0}, {"Continuous", 2}});
  xml.command("AcquisitionStart", reg::kAcquisition, 1);
  xml.command("AcquisitionStop", reg::kAcquisition, 0);
  xml.real("ExposureTimeAbs", reg::kExposure, 4, 1e6, "us");
  xml.real("TriggerDelayAbs", reg::kTriggerDelay, 0, 1e6, "us");
  xml.real("AcquisitionFrameRateAbs", reg::kFramePeriod, 0.1, 100, "Hz", 1'000'000);
  const Selected trigger{"TriggerSelector", reg::kTriggerSelectorStride};
  xml.selector("TriggerSelector", {{"FrameStart", 0}, {"AcquisitionStart", 1}},
               {"TriggerMode", "TriggerSource", "TriggerActivation"});
  xml.choice("TriggerMode", reg::kTriggerMode, {{"Off", 0}, {"On", 1}}, trigger);
  xml.choice(
      "TriggerSource", reg::kTriggerSource,
      {{"Software", reg::kSourceSoftware}, {"Line1", reg::kSourceLine1}, {"Action1", reg::kSourceAction1}},
      trigger);
  xml.choice("TriggerActivation", reg::kTriggerActivation, {{"RisingEdge", 0}, {"FallingEdge", 1}}, trigger);
  xml.command("TriggerSoftware", reg::kTriggerSoftware, 1);
  xml.category("CounterAndTimerControls");
  xml.command("CounterReset", reg::kCounterReset, 1);
  xml.integer("CounterValue", reg::kCounterValue, 0, 0xffffffff, "RO");
}

void write_chunk_features(XmlWriter& xml) {
  xml.category("ChunkDataStreams");
  xml.boolean("ChunkModeActive", reg::kChunkMode);
  xml.selector("ChunkSelector",
               {{"Framecounter", 0}, {"Triggerinputcounter", 1}, {"Timestamp", 2}, {"ExposureTime", 3}},
               {"ChunkEnable"});
  xml.boolean("ChunkEnable", reg::kChunkEnable, {"ChunkSelector", reg::kChunkSelectorStride});
  xml.chunk("ChunkFramecounter", reg::kChunkFramecounterId);
  xml.chunk("ChunkTriggerinputcounter", reg::kChunkTriggerinputcounterId);
  xml.chunk("ChunkTimestamp", reg::kChunkTimestampId);
  xml.chunk("ChunkExposureTime", reg::kChunkExposureTimeId);
}

void write_action_features(XmlWriter& xml) {
  xml.category("ActionControl");
  xml.integer("ActionDeviceKey", reg::kActionDeviceKey, 0, 0xffffffff);
  xml.integer("ActionGroupKey", reg::kActionGroupKey, 0, 0xffffffff);
  xml.integer("ActionGroupMask", reg::kActionGroupMask, 0, 0xffffffff);
}

void write_transport_features(XmlWriter& xml) {
  xml.category("TransportLayer");
  xml.integer("PayloadSize", reg::kPayloadSize, 0, 0xffffffff, "RO");
  xml.packet_size();
  xml.integer("GevSCPD", reg::kPacketDelay, 0, 50'000'000);
  xml.integer("GevSCFTD", reg::kTransmissionDelay, 0, 50'000'000);
  xml.integer("GevHeartbeatTimeout", reg::kHeartbeatTimeout, 500, 3'000'000);
  xml.command("GevTimestampControlLatch", reg::kTimestampControl, 2);
  xml.fixed("GevTimestampTickFrequency", reg::kTickFrequency_hz);
  xml.fixed("TLParamsLocked", 0);
}

}  // namespace

std::string genicam_xml(int sensor_width_px, int sensor_height_px, bool has_ptp) {
  XmlWriter xml;
  xml.category("DeviceInformation");
  xml.text("DeviceVendorName", reg::kVendorName, 32);
  xml.text("DeviceModelName", reg::kModelName, 32);
  xml.text("DeviceManufacturerInfo", reg::kManufacturerInfo, 48);
  xml.text("DeviceVersion", reg::kDeviceVersion, 32);
  xml.text("DeviceSerialNumber", reg::kSerialNumber, 16);
  xml.text("DeviceID", reg::kSerialNumber, 16);
  xml.text("DeviceUserID", reg::kUserName, 16, "RW");
  write_image_features(xml, sensor_width_px, sensor_height_px);
  write_acquisition_features(xml);
  write_chunk_features(xml);
  write_action_features(xml);
  write_transport_features(xml);
  if (has_ptp) {
    xml.category("PtpControl");
    xml.boolean("GevIEEE1588", reg::kPtpEnable);
    xml.choice("GevIEEE1588Status", reg::kPtpStatus,
               {{"Disabled", reg::kPtpDisabled}, {"Slave", reg::kPtpSlave}});
  }
  return xml.finish();
}

}  // namespace flamefield
