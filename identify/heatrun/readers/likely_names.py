"""What the name of a column speaks of, by whole words of seven languages.

A name is split into words: at blanks and signs, at capital letters, between letters and digits. A
word that is not known is split into known ones that make up the whole of it, as in
"Wicklungstemperatur", "Tcu" or "巻線温度". Part of a word is none: a data frame is no frame.
`MEANINGS` says what each word means, `SPOKEN` which meanings make which channel.
"""

import re
import unicodedata
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass
from functools import lru_cache

from ..record.channels import CHANNEL
from ..record.header import STATISTICS
from ..record.units import quantities_of

SURE, LIKELY, WEAK = 3, 2, 1
"""A name can mean nothing else; it speaks for the channel; it allows it and names no other."""

MEANINGS: dict[str, str] = {
    # quantities
    "temperature": "temp temperature temperatures temperatur temperaturen temperatura temps tmp "
    "tc 温度 温 溫度 溫 thermistor ntc ptc kty thermocouple thermal",
    "time": "time times zeit zeitstempel uhrzeit tempo temps tiempo elapsed clock timestamp "
    "timestamps stamp datetime date datum ora heure hora czas fecha today "
    "時間 時刻 日時 経過 时间 日期",
    "current": "current currents curr cur strom strome stroeme corrente corrent courant corriente "
    "amp amps ampere intensidad prad 電流 电流",
    "voltage": "voltage volt volts spannung tensione tension voltaje 電圧 电压 電壓",
    "power": "power pwr watt watts leistung potenza puissance potencia moc psum 電力 功率",
    "speed": "speed spd drehzahl drehz velocita vitesse velocidad velocity vel rpm omega giri "
    "tours regime revs predkosc obr obroty obrotowa rotacao varvtal toerental otacky "
    "geschwindigkeit 回転数 回転速度 转速 轉速 速度",
    "torque": "torque torq trq tq drehmoment drehmom moment coppia couple par momento トルク "
    "转矩 扭矩 轉矩",
    "flow": "flow durchfluss durchfl volumenstrom portata debit caudal 流量",
    "resistance": "resistance widerstand resistenza resistencia ohm 抵抗 电阻 電阻",
    "other_quantity": "freq frequency frequenz frequenza frequence frecuencia hz energy energie "
    "energia wh kwh ah amp_hours watt_hours position pos angle winkel angolo vibration schwingung "
    "pressure druck pressione humidity feuchte inductance duty mass masse massa reactive apparent "
    "blindleistung scheinleistung blind schein reattiva apparente slip schlupf power_factor "
    "wind_speed windgeschwindigkeit 周波数 频率 皮相 無効 无功 视在 風速 风速",
    "efficiency": "efficiency eta η eff_1 wirkungsgrad rendimento rendement rendimiento 効率 效率",
    # what no channel is
    "bookkeeping": "status state error fault faults warn warning alarm count counter counts "
    "zaehler zahler flag flags mode limit limits lim grenz grenze grenzwert threshold set setpoint "
    "soll sollwert target ref reference demand cmd command version serial crc checksum valid "
    "quality index idx id dlc dir data_frame dataframe ueber uber over derating percent konstante "
    "constant gain kp std sd stdev 目標 設定 指令 设定 異常 报警 状態 状态",
    "other_body": "gearbox getriebe gear brake bremse exhaust cell transformer trafo transformator "
    "hydraulic hyd nacelle nac gondel hub nabe blade pitch tire tyre cylinder intake cpu mcu board "
    "wall wand slip_ring spinner spin fuel battery_temp 変圧器 变压器 齿轮箱",
    # where
    "winding": "winding windings wdg wndg wnd wickl wicklung wicklungen spule coil coils avv "
    "avvolgimento avvolgimenti avvolg bobina bobine bobinage enroulement enroul devanado "
    "bobinado arrollamiento uzwojenie uzwojenia copper kupfer rame cuivre cobre "
    "hotspot hot_spot slot 巻線 巻き線 捲線 コイル 绕组 繞組 线圈 線圈",
    "winding_short": "sw cu nut wind wck wckl windg",
    "end_winding": "endwinding end_winding endwdg end_wdg end_turn winding_head wickelkopf "
    "wickelkopfe wickelkoepfe overhang testata tete_de_bobine コイルエンド 端部绕组",
    "ambient": "ambient amb room raum environment environ environnement umgebung umgebungs umgeb "
    "umg umluft luft air aria ambiente ambiante ambiance otoczenie otoczenia stanza sala "
    "piece lab labor laboratorio hall halle aussen outside outdoor env "
    "室温 室溫 周囲 外気 雰囲気 环境 環境 室内 气温 気温",
    "coolant": "coolant cool cooling kuhlmittel kuhlwasser kuehlmittel kuehlwasser kuhl kuehl "
    "water wasser acqua eau agua refrigerant refrigerante refroidissement raffreddamento glycol "
    "glykol oil ol oel olio huile aceite 冷却 冷却水 冷却液 水 水温 水溫 油 油温",
    "inlet": "in inlet vorlauf entree ingresso entrada eintritt mandata 入口 进水 进口",
    "outlet": "out outlet output rucklauf ruecklauf ritorno retour retorno sortie uscita salida "
    "austritt ausgang ausgangs erogata 出口 出水 出力 输出",
    "housing": "housing gehause gehaeuse geh frame case casing carcassa cassa carter carcasse "
    "carcasa hsg jacket mantel body surface oberflache oberflaeche ハウジング フレーム 筐体 ケース "
    "机壳 机座 外壳 壳体 機殻",
    "bearing": "bearing bearings bear brg lager walzlager cuscinetto cuscinetti cuscin palier "
    "roulement cojinete rodamiento 軸受 軸受け ベアリング 轴承 軸承",
    "magnet": "magnet magnets magn magnete aimant calamita iman pm 磁石 磁铁 永磁体 磁钢 磁鋼",
    "rotor": "rotor rot rotore laufer laeufer ローター ロータ 回転子 转子 轉子",
    "yoke": "yoke joch giogo culasse culata 継鉄 ヨーク 轭部",
    "tooth": "tooth teeth zahn zahne zaehne dente denti dent diente ティース 齿部",
    "stator": "stator stat statore staender stander ステータ 固定子 定子",
    "controller": "controller contr inverter inv umrichter wechselrichter frequenzumrichter igbt "
    "mos mosfet fet esc heatsink heat_sink power_stage kuhlkorper convertitore onduleur variateur "
    "inversor driver vfd cont インバータ 逆变器 变频器 控制器 コントローラ",
    "motor": "motor mot motore moteur machine mach maschine masch macchina gen generator em "
    "generatore モータ モーター 電動機 电机 電機 马达 电动机 発電機",
    "vehicle": "vehicle fahrzeug veicolo vehicule vehiculo car road 車両 车辆 車速 车速",
    "fan": "fan lufter luefter ventilator ventilateur ventilatore ventola vent ファン 风扇",
    # of which kind
    "phase": "phase phases phasen fase fases strang str ph phs phse rms line 相 線",
    "electrical": "el elec elek elect electric electrical elektrisch elektrische elektr elettrica "
    "elettrici elettriche elettrico electrique electrica active wirk attiva sigma σ "
    "terminal 123 sum psum 電気 电气 有効 有功",
    "input": "in input eingang eingangs aufgenommen aufgenommene aufnahme assorbita absorbee "
    "absorbida entrada ingresso pobrana pobierana 入力 输入",
    "mechanical": "mech mechanical mechanisch mechanische meccanica meccanico mecanique mecanica "
    "shaft welle wellen albero arbre abgabe abgegeben abgegebene nutz useful utile util resa "
    "oddana oddawana uzyteczna 機械 机械 軸 轴",
    "direct": "dc hv bus vbus batt battery bat batterie batteria bateria link zwischenkreis zk "
    "supply netzteil versorgung 直流 母线 電池 电池 バッテリ",
    "loss": "loss losses verlust verluste perdita perdite perte pertes perdida perdidas dissip "
    "dissipation dissipated verl perd straty strat 損失 损耗 损失 損耗",
    "part": "iron eisen ferro fer fe copper kupfer cu rame cuivre friction reibung",
    "d": "d_axis direct_axis d軸",
    "q": "q_axis quadrature_axis q軸",
    "electrical_speed": "erpm e_rpm omega_e w_e n_e",
    # words that change nothing
    "plain": "the of di de du des der da del della la le im am avg sensor messung mess mid total "
    "tot gesamt totale measurement estimate estimated thermo の 平均 値 实际",
}  # fmt: skip
"""Meaning to its words; "_" joins those of several words."""

QUANTITY = {
    "temperature": {"temperature"},
    "current": {"phase current", "dq current", "direct current"},
    "voltage": {"voltage"},
    "power": {"power"},
    "loss": {"power"},
    "speed": {"speed", "velocity"},
    "electrical_speed": set(),
    "torque": {"torque"},
    "time": {"time"},
    "flow": {"flow"},
    "resistance": set(),
    "efficiency": {"fraction"},
    "other_quantity": set(),
}  # fmt: skip
"""Meaning to the quantities that a column with it in its name may be of."""

SYMBOLS = {
    **dict.fromkeys(("theta", "th", "ϑ", "θ", "t", "T"), "temperature"),
    **{"i": "current", "p": "power", "u": "voltage", "v": "voltage", "n": "speed", "M": "torque"},
}
"""Symbols of formulas to what they stand for; words say it before them."""

UNITS_ALONE = {"V": "voltage direct", "A": "current direct", "Nm": "torque",
               "ThI": "bookkeeping", "ThO": "bookkeeping"}  # fmt: skip
"""Names that are a unit and no more: meters of a battery, such as the Cycle Analyst, write so; its
throttle in and out are no temperatures."""

SUBSCRIPTS = {
    **{"w": "winding_short", "e": "ambient_short", "a": "ambient_short", "0": "ambient_short"},
    **dict.fromkeys(("s", "u", "l", "1"), "plain"),
    **{letter: letter for letter in "dqvm"},
}
"""Single letters behind a symbol: "T_w", "Iq", "P_d"."""

BODIES = ("end_winding", "controller", "coolant", "ambient", "bearing", "magnet", "rotor",
          "winding", "tooth", "yoke", "stator", "housing")  # fmt: skip
"""Where several stand in a name, the first is where the sensor sits: "stator winding"."""

NO_SHAFT = "vehicle winding winding_short fan electrical_speed ambient"
PARTS = f"part controller mechanical {' '.join(BODIES)}"
SPOKEN: tuple[tuple[str, str, str, int], ...] = (
    ("time_s", "time", "", SURE),
    ("end_winding_degC", "end_winding", "", SURE),
    ("winding_degC", "winding", "", SURE),
    ("winding_degC", "temperature winding_short", "inlet outlet", LIKELY),
    ("winding_degC", "temperature phase", "", LIKELY),
    ("winding_degC", "temperature motor", "inlet outlet mechanical", LIKELY),
    ("winding_degC", "temperature", "inlet outlet mechanical direct fan", WEAK),
    ("ambient_degC", "ambient", "", SURE),
    ("ambient_degC", "temperature ambient_short", "phase motor winding_short", LIKELY),
    ("ambient_degC", "temperature", "inlet outlet mechanical direct fan motor phase", WEAK),
    ("coolant_out_degC", "coolant outlet", "", SURE),
    ("coolant_out_degC", "temperature outlet", "", LIKELY),
    ("coolant_degC", "coolant", "outlet", SURE),
    ("coolant_degC", "temperature inlet", "", LIKELY),
    *((f"{body}_degC", body, "", SURE)
      for body in ("housing", "bearing", "magnet", "rotor", "yoke", "tooth", "stator",
                   "controller")),
    ("phase_current_A", "current phase", "direct input d q", SURE),
    ("phase_current_A", "current", "direct input d q fan", LIKELY),
    ("losses_W", "loss", PARTS, SURE),
    ("losses_W", "power d", f"{PARTS} electrical input", LIKELY),
    ("losses_W", "power v", f"{PARTS} electrical input", LIKELY),
    ("losses_W", "power", f"{PARTS} electrical input direct outlet phase motor", WEAK),
    ("speed_rpm", "speed", NO_SHAFT, SURE),
    ("torque_Nm", "torque", "loss", SURE),
    ("dc_voltage_V", "voltage direct", "", SURE),
    ("dc_voltage_V", "voltage input", "", LIKELY),
    ("dc_voltage_V", "voltage", "phase motor d q", WEAK),
    ("dc_current_A", "current direct", "", SURE),
    ("dc_current_A", "current input", "", LIKELY),
    ("dc_power_W", "power direct", "loss", SURE),
    ("electrical_power_W", "power electrical", "loss direct mechanical phase", SURE),
    ("electrical_power_W", "power input", "loss direct mechanical phase", SURE),
    ("electrical_power_W", "power", "loss direct mechanical phase outlet part", WEAK),
    ("mechanical_power_W", "power mechanical", "loss", SURE),
    ("mechanical_power_W", "power outlet", "loss", LIKELY),
    ("mechanical_power_W", "power m", "loss", LIKELY),
    ("efficiency", "efficiency", f"{PARTS} fan", SURE),
    ("winding_voltage_V", "voltage", "input d q", WEAK),
    ("u_d_V", "voltage d", "", LIKELY),
    ("u_q_V", "voltage q", "", LIKELY),
    ("i_d_A", "current d", "", LIKELY),
    ("i_q_A", "current q", "", LIKELY),
    ("coolant_flow_L_per_min", "flow", "", LIKELY),
    ("vehicle_speed_km_per_h", "speed vehicle", "", SURE),
    ("vehicle_speed_km_per_h", "vehicle", "", LIKELY),
    ("fan", "fan", "", LIKELY),
)  # fmt: skip
"""Channel, the meanings that it needs, those that exclude it, and how surely they speak for it."""

NOT_THE_SHAFTS = (
    "it is the electrical speed: divided by the number of pole pairs, in the file, it is speed_rpm"
)
"""What is missing where a file has the electrical speed alone."""

EAST_ASIAN = "\u3005\u3040-\u30ff\u3400-\u9fff"
WORD = re.compile(rf"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|[0-9]+|[α-ωϑΑ-Ω]|[{EAST_ASIAN}]+")
DEVICE = re.compile(r"\\[\w:.]+$")
"""The device behind a label of INCA, as in "T_Wckl\\ETKC:1"."""

ACCENTS = re.compile("[\u0300-\u036f]")
SHORTEST_PART = 3
LINKS = ("", "s", "n", "es", "en", "e")
"""What German puts between the words of one: "Wicklungstemperatur"."""


@dataclass(frozen=True)
class Spoken:
    """What a name says."""

    meanings: frozenset[str]  # Of its words.
    # Each of its words is known, and none is a number or takes a part of the values.
    is_clear: bool
    is_symbol: bool  # Its quantity is said by a symbol alone.
    is_extreme: bool = False  # It takes a part of the values, as "max" does.

    @property
    def is_electrical_speed(self) -> bool:
        """It is the speed of the field, the shaft's times the pole pairs."""
        is_fields = {"speed", "electrical"} <= self.meanings and "motor" not in self.meanings
        return "electrical_speed" in self.meanings or is_fields


@lru_cache(maxsize=16384)
def likely_channels(name: str, unit: str | None = None) -> dict[str, int]:
    """Return the channels that a column's name speaks of and how surely, the surest first.

    Example:
        >>> likely_channels("Wicklungstemperatur")
        {'winding_degC': 3}
    """
    spoken = read_name(name)
    said = spoken.meanings
    if "bookkeeping" in said or spoken.is_electrical_speed:
        return {}
    wanted = _quantities(said, {*quantities_of(unit)} if unit else set())
    if wanted is not None and not said & QUANTITY.keys():
        said |= {one for one, kinds in QUANTITY.items() if wanted & kinds} - {"loss"}
    body = next((one for one in BODIES if one in said), "")
    said = said - {*BODIES} | {body} if body else said
    is_open = spoken.is_symbol or not spoken.meanings & QUANTITY.keys()
    found: dict[str, int] = {}
    for channel, needs, excluded, score in SPOKEN:
        quantity = CHANNEL[channel].quantity
        is_told = said >= {*needs.split()} and not said & {*excluded.split()}
        if not is_told or (wanted is not None and quantity not in wanted):
            continue
        if quantity == "temperature":
            is_others = body and channel not in (f"{body}_degC", f"{body}_out_degC")
            if is_others or "other_body" in said:
                continue
        # a coil without a unit may be anything of the coil
        score = min(score, LIKELY) if (is_open and not unit) or spoken.is_extreme else score
        found[channel] = max(score, found.get(channel, 0))
    return dict(sorted(found.items(), key=lambda one: -one[1]))


def _quantities(said: Set[str], stated: set[str]) -> set[str] | None:
    """Return the quantities that a name and its unit allow, None for any."""
    named = [QUANTITY[one] for one in said if one in QUANTITY]
    if not named:
        return stated or None
    # "power loss" is a power, "speed of time" one or the other
    allowed = set.intersection(*named) or (set.union(*named) if all(named) else set())
    return allowed & stated if stated else allowed


def read_name(name: str) -> Spoken:
    """Return what the words of a name mean, without its unit, whose letters would be words."""
    if name in UNITS_ALONE:
        return Spoken(frozenset(UNITS_ALONE[name].split()), False, False)
    words = _words(name)
    if len(words) > 2 and words[0] in ("M", "m") and words[1].isdigit():  # "M1.T_w", of a motor
        own = read_name(" ".join(words[2:]))
        if own.meanings & (QUANTITY.keys() | {*BODIES}):
            return own
    meanings: set[str] = set()
    by_symbol, is_clear, is_extreme, place = "", bool(words), False, 0
    while place < len(words):
        size = next(n for n in (3, 2, 1) if n == 1 or _key(words[place : place + n]) in KNOWN)
        word, key = words[place], _key(words[place : place + size])
        place += size
        symbol = SYMBOLS.get(word) or SYMBOLS.get(key) if size == 1 else None
        if by_symbol and key in SUBSCRIPTS and words[place - 2].casefold() in SYMBOL_WORDS:
            meanings.add(SUBSCRIPTS[key])
        elif key in ("u", "v") and meanings & {*BODIES}:
            meanings.add("plain")  # a phase: "coil_U"
        elif symbol and not by_symbol:
            by_symbol = "time" if words == ["t"] else symbol
        elif key in KNOWN:
            meanings |= KNOWN[key]
        elif key in ("d", "q"):
            meanings.add(key)
        else:
            is_clear = False
        is_extreme |= key in EXTREMES
        is_clear &= key not in EXTREMES and (not key.isdigit() or key == "0")
    is_symbol = bool(by_symbol) and not meanings & QUANTITY.keys()
    said = meanings | {by_symbol} if is_symbol else meanings
    return Spoken(frozenset(said), is_clear, is_symbol, is_extreme)


def _key(words: Sequence[str]) -> str:
    return "_".join(words).casefold()


def _words(name: str) -> list[str]:
    """Return the words of a name, those that are several taken apart."""
    text = unicodedata.normalize("NFKC", DEVICE.sub("", name[:LONGEST]))
    text = ACCENTS.sub("", unicodedata.normalize("NFD", text))
    text = unicodedata.normalize("NFC", text).replace("ß", "ss")
    return [part for word in WORD.findall(text) for part in _parts(word)]


def _parts(word: str) -> tuple[str, ...]:
    key = word.casefold()
    if word in ("Id", "id", "Pm"):  # ID is a number, PM the magnets
        return (word[0], word[1])
    if key in KNOWN or key in SYMBOL_WORDS or len(key) == 1:
        return (word,)
    if ord(key[0]) >= FIRST_EAST_ASIAN:
        return tuple(_east_asian(key))
    if made := _made_of(key):
        return made
    for symbol in (*SYMBOL_WORDS, "temp"):
        rest = key.removeprefix(symbol)
        if len(rest) < len(key) and (rest in KNOWN or rest in SUBSCRIPTS):
            return (word[: len(symbol)], rest)
    return (word,)


def _made_of(key: str) -> tuple[str, ...]:
    """Return the known words that a word is made of from its beginning to its end, or none."""
    for size in range(len(key) - SHORTEST_PART, SHORTEST_PART - 1, -1):
        if key[:size] not in KNOWN:
            continue
        for link in LINKS:
            rest = key[size:].removeprefix(link) if key[size:].startswith(link) else ""
            if rest in KNOWN and len(rest) >= SHORTEST_PART:
                return (key[:size], rest)
            if len(rest) >= 2 * SHORTEST_PART and (more := _made_of(rest)):
                return (key[:size], *more)
    return ()


def _east_asian(text: str) -> Iterator[str]:
    """Yield the longest known words of a text without blanks, and what is left between them."""
    place = 0
    while place < len(text):
        size = next((n for n in range(LONGEST_WORD, 1, -1) if text[place : place + n] in KNOWN), 1)
        yield text[place : place + size]
        place += size


def _known() -> dict[str, frozenset[str]]:
    known: dict[str, set[str]] = {word: {"plain"} for word in STATISTICS}
    for meaning, words in MEANINGS.items():
        for word in words.split():
            known.setdefault(word, set()).add(meaning)
    return {word: frozenset(meanings) for word, meanings in known.items()}


KNOWN = _known()
EXTREMES = frozenset(
    ("min", "max", "minimum", "maximum", "median", "med", "raw", "corr", "corrected", "sum", "abs",
     "peak", "pk", "ampl", "amplitude")
)  # fmt: skip
"""Words behind which a column is another than the one that is meant, or not quite that."""

SYMBOL_WORDS = tuple(sorted({one.casefold() for one in SYMBOLS} | {"m"}, key=len, reverse=True))
LONGEST_WORD = 8
LONGEST = 300
FIRST_EAST_ASIAN = 0x3000
