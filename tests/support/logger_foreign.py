"""Files in the forms of makers' loggers and programs, as their manuals and exports show them: header lines and all."""

from __future__ import annotations

from datetime import timedelta
from math import radians

from logger_files import Case, Truth, german_number, instant_at, lines_of, text

_EPOCH_MS = 1_772_352_000_000
_NARROW = "\u202f"  # no-break space of French thousands


@text("ascii", "\r\n")
def campbell(t: Truth) -> list[str]:
    return [
        '"TOA5","CR1000X","CR1000X","12345","CR1000X.Std.05.01","CPU:gyro.CR1X","4062","Table1"',
        '"TIMESTAMP","RECORD","BattV_Min","T_gyro_Avg","Rate_Avg"',
        '"TS","RN","Volts","Deg C","deg/h"',
        '"","","Min","Avg","Avg"',
        *lines_of(t, lambda k, s, c, r: f'"{instant_at(s):%Y-%m-%d %H:%M:%S}",{k},12.7,{c!r},{r[0]!r}'),
    ]


@text("ascii", "\r\n")
def keysight(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        return f"{k + 1},{instant_at(s):%m/%d/%Y %H:%M:%S}:000,{c!r},{r[0] / 40.0!r}"

    return ["Sweep #,Time,Chan 101 (C),Chan 202 (VDC)", *lines_of(t, row)]


@text("ascii", "\r\n")
def benchlink(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        return f"{k + 1},{instant_at(s):%m/%d/%Y %H:%M:%S}:000,{c!r},0,{r[0] / 40.0!r},0"

    return [
        "Name:,gyro 7", "Owner:,lab", "Comments:,", "Acquisition Date:,3/1/2026 8:00:00 AM",
        "Instrument:,34970A Address: 109", "Total Channels:,2",
        "Channel,Name,Function,Range,Resolution,Gain,Offset,Label",
        "101,T_gyro,Temp (Type K),,,1,0,C", "202,Rate,DC Voltage,AUTO,5.5,1,0,VDC",
        "Scan Control:", "Start Action:,Immediately", "",
        "Scan,Time,101 <T_gyro> (C),Alarm 101,202 <Rate> (VDC),Alarm 202",
        *lines_of(t, row),
    ]  # fmt: skip


def _lvm(separator: str, decimal: str) -> list[str]:
    s = separator
    return [
        f"LabVIEW Measurement{s}", f"Writer_Version{s}2", f"Reader_Version{s}2", "Separator\tTab",
        f"Decimal_Separator{s}{decimal}", f"Multi_Headings{s}No", f"X_Columns{s}One", "Time_Pref\tRelative",
        f"Operator{s}A. Berg", f"Date{s}2026/03/01", f"Time{s}08:00:00,0", f"***End_of_Header***{s}", s,
        f"Channels{s}2{s * 2}", f"Samples{s}240{s}240{s}", f"Date{s}2026/03/01{s}2026/03/01{s}",
        f"Time{s}08:00:00{s}08:00:00{s}", f"Y_Unit_Label{s}deg C{s}deg/s{s}",
        f"X_Dimension{s}Time{s}Time{s}", f"X0{s}0{s}0{s}", f"Delta_X{s}10{s}10{s}",
        f"***End_of_Header***{s * 3}",
        f"X_Value{s}Temperature{s}Rate{s}Comment",
    ]  # fmt: skip


@text("cp1252", "\r\n")
def labview(t: Truth) -> list[str]:
    return [*_lvm("\t", "."), *lines_of(t, lambda k, s, c, r: f"{s:.6f}\t{c:.9f}\t{r[0] / 3600:.12f}\t")]


@text("cp1252", "\r\n")
def labview_german(t: Truth) -> list[str]:
    return [
        *_lvm("\t", ","),
        *lines_of(t, lambda k, s, c, r: f"{german_number(s)}\t{german_number(c)}\t{german_number(r[0] / 3600, 12)}\t"),
    ]


@text("utf-8-sig", "\r\n")
def hobo(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        logged = "Logged" if k == 0 else ""
        return f"{k + 1},{instant_at(s):%m/%d/%y %I:%M:%S %p},{c * 1.8 + 32!r},{r[0]!r},{logged}"

    return [
        '"Plot Title: gyro"',
        '"#","Date Time, GMT+00:00","Temp, °F (LGR S/N: 10345, SEN S/N: 10345, LBL: gyro)",'
        '"Rate, deg/h (LGR S/N: 10345, SEN S/N: 10346)","Coupler Attached (LGR S/N: 10345)"',
        *lines_of(t, row),
    ]


@text("ascii", "\r\n")
def xsens(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        gyr = "\t".join(repr(radians(v / 3600)) for v in r)
        return f"{(65500 + k) % 65536}\t{round(s * 1e4)}\tNaN\tNaN\t0.06\t-0.01\t9.81\t{gyr}\t{c!r}\t"

    return [
        "// General information:", "//  MT Manager version: 2022.2.0", "// Device information:",
        "//  DeviceId: 00B42D4F", "//  ProductCode: MTI-670", "// Device settings:",
        "//  Filter Profile: human(46.1)", "// Coordinate system: ENU",
        "PacketCounter\tSampleTimeFine\tYear\tMonth\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z\tTemperature\t",
        *lines_of(t, row),
    ]  # fmt: skip


@text("utf-8", "\r\n")
def vectornav(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        return f"{round(s * 1e9)}," + ",".join(repr(radians(v / 3600)) for v in r) + f",{c!r},101.325"

    return [
        "Time.TimeStartup [ns],Imu.UncompGyro.X [rad/s],Imu.UncompGyro.Y [rad/s],Imu.UncompGyro.Z [rad/s],"
        "Imu.Temp [C],Imu.Pres [kPa]",
        *lines_of(t, row),
    ]


@text()
def sbg(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        gyro = "\t".join(repr(v / 3600) for v in r)
        return f"{round(s * 1e6)}\t127\t0.1\t0.2\t9.8\t{gyro}\t{c!r}"

    return [
        "timestamp\tstatus\taccelX\taccelY\taccelZ\tgyroX\tgyroY\tgyroZ\ttemperature",
        "(us)\t(na)\t(m.s^-2)\t(m.s^-2)\t(m.s^-2)\t(deg.s^-1)\t(deg.s^-1)\t(deg.s^-1)\t(degC)",
        *lines_of(t, row),
    ]


@text("ascii", "\r\n")
def adis(t: Truth) -> list[str]:
    """32-bit register values of an evaluation board, 655360 to 1 deg/s, 0.1 C each; no times."""

    def row(k: int, s: float, c: float, r: list[float]) -> str:
        return f"{k},{r[0] / 3600 * 655360 * 1000:.0f},{round(c * 10000)}"

    return ["DATA_CNTR,Z_GYRO_OUT,TEMP_OUT", *lines_of(t, row)]


@text("utf-16-le", "\r\n")
def excel(t: Truth) -> list[str]:
    """'Unicode text' of a German spreadsheet: UTF-16 with a mark, tabs, decimal commas."""

    def row(k: int, s: float, c: float, r: list[float]) -> str:
        return f"{instant_at(s):%d.%m.%Y %H:%M:%S}\t{german_number(c)}\t{german_number(r[0])}"

    return ["\ufeffDatum/Uhrzeit\tTemperatur Kreisel (°C)\tDrehrate (°/h)", *lines_of(t, row)]


@text("cp1252", "\r\n")
def chamber(t: Truth) -> list[str]:
    """The log of a climate chamber whose recorder also had the gyro."""

    def row(k: int, s: float, c: float, r: list[float]) -> str:
        one = f"{instant_at(s):%d.%m.%Y};{instant_at(s):%H:%M:%S}"
        return (
            f"{one};{german_number(c + 1.5, 1)};{german_number(c + 1.0, 1)};{german_number(c)};{german_number(r[0])};"
        )

    return [
        "Archiv;VT 4020", "Anlagennummer;58566123", "Programm;Kreisel 5K/min", "",
        "Datum;Uhrzeit;Temperatur Sollwert [°C];Temperatur Istwert [°C];Pt100 Kreisel [°C];Drehrate [°/h];",
        *lines_of(t, row),
    ]  # fmt: skip


def _thousands(value: float, mark: str, digits: int) -> str:
    return f"{value:,.{digits}f}".replace(".", ";").replace(",", mark).replace(";", ",")


@text("utf-8", "\r\n")
def german_thousands(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        return f"{_thousands(s, '.', 1)};{german_number(c)};{german_number(r[0])}"

    return ["Zeit [s];Temperatur [°C];Drehrate [°/h]", *lines_of(t, row)]


@text("utf-8", "\r\n")
def french_thousands(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        return f"{_thousands(s, _NARROW, 1)};{german_number(c)};{german_number(r[0])}"

    return ["Temps (s);Température (°C);Vitesse angulaire (°/h)", *lines_of(t, row)]


@text()
def epoch_ms(t: Truth) -> list[str]:
    return [
        "timestamp,temperature_c,rate_dph",
        *lines_of(t, lambda k, s, c, r: f"{_EPOCH_MS + round(s * 1e3)},{c!r},{r[0]!r}"),
    ]


@text()
def gps(t: Truth) -> list[str]:
    """Week and time of week, over the end of a week."""

    def row(k: int, s: float, c: float, r: list[float]) -> str:
        tow = 604_000.0 + s
        gyro = ",".join(repr(v / 3600) for v in r)
        return f"{2408 + int(tow // 604_800)},{tow % 604_800!r},{gyro},{c!r}"

    return [
        "GPS Week,GPS TOW (s),Gyro X (deg/s),Gyro Y (deg/s),Gyro Z (deg/s),IMU Temperature (deg C)",
        *lines_of(t, row),
    ]


@text("ascii", "\r\n")
def graphtec(t: Truth) -> list[str]:
    """Signs are separated from the digits, the milliseconds in a column of their own."""

    def row(k: int, s: float, c: float, r: list[float]) -> str:
        return f"{k + 1},{instant_at(s):%Y/%m/%d %H:%M:%S},000,+ {c:.9f},+ {r[0]:.9f},LLLLLLLLLL,LLLL"

    return [
        "Vendor,GRAPHTEC Corporation", "Model,GL840,Version,Ver1.10", "Sampling interval,10s",
        "Total data points,240", "AMP settings", "CH,Signal name,Input,Range,Filter,Span",
        "CH1,T_gyro,TEMP,TC_K,Off,200.0,-200.0,degC", "CH2,rate,DC,1V,Off,100.0,-100.0,deg/h",
        "Logic/Pulse,Off", "Data",
        "Number,Date&Time,ms,T_gyro,rate,Alarm1-10,AlarmOut",
        "NO.,Time,ms,degC,deg/h,A1234567890,A1234",
        *lines_of(t, row),
    ]  # fmt: skip


@text()
def mems_studio(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        return f"{round(s * 1e6)}\t" + "\t".join(repr(v / 3.6) for v in r) + f"\t{c!r}"

    return ["Time [us]\tG_X [mdps]\tG_Y [mdps]\tG_Z [mdps]\tTemperature [C]", *lines_of(t, row)]


@text()
def rostopic(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        stamp = 1_772_352_000_000_000_000 + round(s * 1e9)
        gyro = ",".join(repr(radians(v / 3600)) for v in r)
        return f"{stamp},{k},{stamp},imu_link,{gyro},0.1,0.2,9.8,{c!r}"

    gyro = ",".join(f"field.angular_velocity.{axis}" for axis in "xyz")
    accel = ",".join(f"field.linear_acceleration.{axis}" for axis in "xyz")
    return [
        f"%time,field.header.seq,field.header.stamp,field.header.frame_id,{gyro},{accel},field.temperature",
        *lines_of(t, row),
    ]


@text()
def ulog2csv(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        gyro = ",".join(repr(radians(v / 3600)) for v in r)
        return f"{round(s * 1e6)},{round(s * 1e6)},2621450,{gyro},{c!r},0,0,0,0"

    return [
        "timestamp,timestamp_sample,device_id,x,y,z,temperature,error_count,clip_counter[0],clip_counter[1],"
        "clip_counter[2]",
        *lines_of(t, row),
    ]


@text("ascii", "\r\n")
def fluke(t: Truth) -> list[str]:
    """A data acquisition unit: local stamps with a.m. and p.m., a column of status beside each channel."""

    def row(k: int, s: float, c: float, r: list[float]) -> str:
        at = instant_at(s)
        return f"{k + 1},{at.month}/{at.day}/{at.year} {at:%I:%M:%S.}000 {at:%p},{c!r},OK,{r[0]!r},OK"

    return ["Scan,Time,Ch101 T_gyro (Deg C),Ch101 Status,Ch102 Rate (Deg/Hr),Ch102 Status", *lines_of(t, row)]


@text()
def honeywell(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        gyro = ", ".join(repr(radians(v / 3600)) for v in r)
        return f"{k}, {s!r}, {gyro}, {c!r}"

    return [
        "Message Count, Elapsed Time (sec), Angular Rate X (rad/sec), Angular Rate Y (rad/sec), "
        "Angular Rate Z (rad/sec), Gyro Temp (degC)",
        *lines_of(t, row),
    ]


@text()
def keithley(t: Truth) -> list[str]:
    """Time of day with parts in brackets of its own, a relative time beside it."""

    def row(k: int, s: float, c: float, r: list[float]) -> str:
        at = instant_at(s) + timedelta(milliseconds=0)
        return f"{k + 1},{r[0]!r},{s:.6f},{at:%m/%d/%Y},{at:%H:%M:%S},0.000000,{c!r}"

    return [
        '"Model","DMM6500"', '"Serial number","04450123"', '"Buffer","defbuffer1"', "",
        "Index,Rate (deg/h),Relative Time (s),Date,Time,Fractional Seconds,Temperature (Celsius)",
        *lines_of(t, row),
    ]  # fmt: skip


@text()
def parts(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        at = instant_at(s)
        return f"{at.year},{at.month},{at.day},{at.hour},{at.minute},{at.second},{c!r},{r[0]!r}"

    return ["Year,Month,Day,Hour,Minute,Second,temp_c,rate_dph", *lines_of(t, row)]


@text("ascii", "\r\n")
def milliseconds(t: Truth) -> list[str]:
    """Two rows a second: whole seconds in the stamp, the rest in the next column."""

    def row(k: int, s: float, c: float, r: list[float]) -> str:
        at = instant_at(s / 20.0)
        return f"{k + 1},{at:%Y/%m/%d %H:%M:%S},{at.microsecond // 1000},{c!r},{r[0]!r}"

    return ["Number,Date&Time,ms,T_gyro,rate", "NO.,Time,ms,degC,deg/h", *lines_of(t, row)]


@text()
def imar(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        return f"{400_000 + s:.3f} {' '.join(f'{v / 3600:.12f}' for v in r)} 0.1 {c:.9f}"

    return [
        "% IMU data, decoded",
        "%GPS-Time [s] omg_x[deg/s] omg_y[deg/s] omg_z[deg/s] acc_x [m/s2] Temp [degC]",
        *lines_of(t, row),
    ]


@text("ascii")
def hexadecimal(t: Truth) -> list[str]:
    """Milliseconds of a counter as a debugger prints them; the unit of the rate behind a blank."""
    return [
        "tick_ms,Temp C,Rate deg/hr",
        *lines_of(t, lambda k, s, c, r: f"0x{round(1000 * s):08X},{c!r},{r[0]!r}"),
    ]


@text()
def pipes(t: Truth) -> list[str]:
    return [
        "|time s|T degC|rate deg / h|",
        "|---|---|---|",
        *lines_of(t, lambda k, s, c, r: f"|{s!r}|{c!r}|{r[0]!r}|"),
    ]


FOREIGN = [
    Case("Campbell Scientific TOA5", "toa5.dat", campbell),
    Case(
        "Keysight 34972A, a voltage",
        "dat00001.csv",
        keysight,
        (
            "--column",
            "rate=Chan 202 (VDC)",
            "--rate-unit",
            "40 deg/h",
            "--set",
            "time.format=%m/%d/%Y %H:%M:%S:%f",
        ),
    ),
    Case(
        "BenchLink, channels described above",
        "benchlink.csv",
        benchlink,
        (
            "--column",
            "rate=202 <Rate> (VDC)",
            "--rate-unit",
            "40 deg/h",
            "--set",
            "time.format=%m/%d/%Y %H:%M:%S:%f",
        ),
    ),
    Case("LabVIEW LVM", "test.lvm", labview),
    Case("LabVIEW LVM, decimal commas", "messung.lvm", labview_german),
    Case("HOBO, fahrenheit", "hobo.csv", hobo, ("--set", "time.format=%m/%d/%y %I:%M:%S %p"), started=True),
    Case(
        "Xsens MT Manager",
        "MT_0001.txt",
        xsens,
        ("--time-unit", "0.1 ms", "--rate-unit", "rad/s", "--temperature-unit", "degC"),
        axes=True,
    ),
    Case("VectorNav", "vn.csv", vectornav, axes=True),
    Case("SBG", "imu.txt", sbg, axes=True),
    Case(
        "ADIS evaluation, counts",
        "adis.csv",
        adis,
        ("--set", "time.rate_hz=0.1", "--rate-unit", "deg/s/655360000", "--temperature-unit", "0.0001 degC"),
        tolerance=1e-5,
        temperature_tolerance=1e-4,
    ),
    Case("Excel, Unicode text", "excel.txt", excel),
    Case("climate chamber", "archiv.csv", chamber),
    Case("German thousands points", "tausend.csv", german_thousands),
    Case("French thousands blanks", "mille.csv", french_thousands),
    Case("milliseconds of an epoch", "ms.csv", epoch_ms, ("--time-unit", "ms")),
    Case("GPS week and time of week", "gps.csv", gps, axes=True, starts_at=604_000.0),
    Case("Graphtec GL840", "gl.csv", graphtec),
    Case("MEMS Studio, mdps", "mems.txt", mems_studio, axes=True),
    Case(
        "rostopic echo -p",
        "imu.csv",
        rostopic,
        ("--time-unit", "ns", "--rate-unit", "rad/s", "--temperature-unit", "degC"),
        axes=True,
    ),
    Case(
        "ulog2csv",
        "log_sensor_gyro_0.csv",
        ulog2csv,
        ("--time-unit", "us", "--rate-unit", "rad/s", "--temperature-unit", "degC"),
        axes=True,
    ),
    Case("Fluke, AM and PM", "fluke.csv", fluke, ("--set", "time.format=%m/%d/%Y %I:%M:%S.%f %p")),
    Case("Honeywell", "hg.csv", honeywell, axes=True),
    Case("parts of the time in columns", "parts.csv", parts),
    Case(
        "decoded by a maker's tool, blanks in names",
        "decoded.txt",
        imar,
        axes=True,
        starts_at=400_000.0,
        tolerance=1e-5,
        temperature_tolerance=1e-8,
    ),
    Case("Keithley DMM6500", "dmm.csv", keithley, ("--column", "time=Relative Time (s)")),
    Case("a counter in hexadecimal digits", "ticks.csv", hexadecimal, tolerance=1e-3),
    Case("a table between bars, out of a report", "bars.txt", pipes),
]
